/* Where the map between two shapes is bad: warnings of a merge's report. */
#ifndef ORB_MERGE_WARN_H
#define ORB_MERGE_WARN_H

#include "orbmorph/merge.h"

/* One mesh in the positions of two shapes. */
typedef struct orb_warn_pair {
  const int32_t *triangles;
  int32_t triangle_count, vertex_count;
  const double *position[2]; /* 3 per vertex */
  const double *move[2];     /* 4×4, column-major: similarities that lay the shapes onto each other; only for thin */
} orb_warn_pair;

/* Fills share and parts where the symmetric Dirichlet energy exceeds 20 on more than 1 % of the area of either shape,
 * with both scaled to the same area; otherwise part_count is 0. O(n log n). */
ORB_MUST_CHECK orb_status orb_warn_stretched(orb_context *ctx, const orb_warn_pair *pair, orb_warning *out);

/* Fills share and parts with the patches, about 200 over the surface, that keep less than half of their area halfway
 * through the linear morph, relative to the mean of both ends, as the shapes lie on each other; otherwise part_count is
 * 0. O(200 n). */
ORB_MUST_CHECK orb_status orb_warn_thin(orb_context *ctx, const orb_warn_pair *pair, orb_warning *out);

#endif
