/* The correspondence of two shapes without landmarks: rough maps, ranked by how much they bend the shapes.
 *
 * Decimated copies of both shapes are registered to each other along each rough map, in both directions
 * (elastic/elastic.h). The maps come from the eigenfunctions (spectral/spectral.h), which do not mind a pose, and from
 * rotations of the spheres (align/rotate/correlate.h), which do not mind other proportions. A map of the right limbs
 * bends the copies least, and the tips of limbs may be off; a twin (left and right swapped with front and back) bends
 * them more, and is also rotated in space. */
#ifndef ORB_ALIGN_FIND_MATCH_H
#define ORB_ALIGN_FIND_MATCH_H

#include "align/find/candidates.h"

typedef struct orb_match {
  int is_found;  /* 0: a shape has too few vertices, or no map was found; nothing else is filled then */
  double cost;   /* of the best map: how much it bends, times 1 to 1 + ORB_FIND_TURN_COST for its rotation in space */
  double clear;  /* 0 to 1: how far the next best map that differs is behind */
  int32_t count; /* of pairs of vertices that correspond roughly; the ends of limbs come first */
  int32_t first[ORB_CANDIDATE_PAIRS], second[ORB_CANDIDATE_PAIRS];
  double *target; /* where each vertex of the second shape lies on the first one, in its space: 3 a vertex */
} orb_match;

/* Free `out` in any case. About 1 s of one thread, whatever the size; trials run on all threads, and the result has the
 * same bytes for any number of them. */
ORB_MUST_CHECK orb_status orb_match_find(orb_context *ctx, const orb_mesh *first, const orb_mesh *second,
                                         orb_match *out);
void orb_match_free(orb_context *ctx, orb_match *match);

#endif
