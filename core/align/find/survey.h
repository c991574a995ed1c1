/* What all trials of two copies share of one of them. */
#ifndef ORB_ALIGN_FIND_SURVEY_H
#define ORB_ALIGN_FIND_SURVEY_H

#include "elastic/surroundings.h"

typedef struct orb_survey {
  orb_surroundings around; /* of each vertex */
  orb_nearest *tree;
  float *apart; /* distances along the surface between all vertices, n × n; NULL: not measured */
} orb_survey;

/* measured: fills `apart`, in O(n² log n): 0.02 s of one thread for 350 vertices. Otherwise O(n²). Free `out` in any
 * case. */
ORB_MUST_CHECK orb_status orb_survey_create(orb_context *ctx, const orb_mesh *mesh, int measured, orb_survey *out);
void orb_survey_free(orb_context *ctx, orb_survey *survey);

/* The vertex of the surveyed mesh nearest to a point of space: a corner of the nearest triangle. */
int32_t orb_survey_nearest(const orb_survey *survey, const orb_mesh *mesh, const double point[3]);

#endif
