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

/* The distance between two vertices of the surveyed mesh, which must have been measured. */
static inline double orb_survey_apart(const orb_survey *survey, const orb_mesh *mesh, int32_t v, int32_t u) {
  return (double)survey->apart[(size_t)v * (size_t)mesh->vertex_count + (size_t)u];
}

/* The vertex of the surveyed mesh nearest to a point of space: a corner of the nearest triangle. */
int32_t orb_survey_nearest(const orb_survey *survey, const orb_mesh *mesh, const double point[3]);

/* The same for `count` points: 3 coordinates each, one vertex each. */
void orb_survey_images(const orb_survey *survey, const orb_mesh *mesh, const double *points, int32_t count,
                       int32_t *out);

#endif
