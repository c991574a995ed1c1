/* How a pose stretches the surroundings of each vertex. */
#ifndef ORB_ELASTIC_STRETCH_H
#define ORB_ELASTIC_STRETCH_H

#include "elastic/body.h"

typedef struct orb_stretch {
  double *linear;        /* 9 per vertex, row-major: what the pose makes of its surroundings, rotated and stretched */
  double *given;         /* smoothed moments of the edges as given; 9 per vertex */
  double *moment, *next; /* of the edges now with those; 9 per vertex */
} orb_stretch;

/* For the vertices of a body. Free `out` in any case. O(n · rounds of smoothing), on all threads. */
ORB_MUST_CHECK orb_status orb_stretch_create(orb_context *ctx, const orb_body *body, orb_stretch *out);
void orb_stretch_free(orb_context *ctx, orb_stretch *stretch);

/* Fits stretch->linear to a body at these positions (3 per vertex), whose vertices have rotated so far (9 each).
 * O(n · rounds of smoothing), on all threads. */
void orb_stretch_fit(orb_context *ctx, const orb_body *body, const double *position, const double *rotation,
                     orb_stretch *stretch);

#endif
