/* Alignment without landmarks: which points of two shapes correspond, by rough maps, ranked by how much they bend the
 * shapes.
 *
 * Comes in: two meshes. Goes out: where each vertex of the second lies on the first. Read in this order:
 *
 *   match.h   the best of the rough maps
 *   found.h   the landmarks that an alignment found, and their confidence
 *   params.h  all thresholds
 *
 * Decimated copies of both shapes are registered to each other along each rough map, in both directions
 * (elastic/elastic.h). The maps come from the eigenfunctions (spectral/spectral.h), which do not mind a pose, and from
 * rotations of the spheres (align/rotate/correlate.h), which do not mind other proportions. A map of the right limbs
 * bends the copies least, and it may be off at their tips; a twin (left and right swapped with front and back) bends
 * them more, and often also rotates them in space.
 *
 * Rejected: ranking candidates by the energy of their composed maps on the coarse copies. It depends on how a walk
 * went: one right map came to 4.05, and to 1.37 with its tips shifted a little, which is as much as right and wrong
 * differ. */
#ifndef ORB_ALIGN_FIND_MATCH_H
#define ORB_ALIGN_FIND_MATCH_H

#include "orbmorph/mesh.h"

enum { ORB_MATCH_PAIRS = 12 }; /* most pairs of a match */

typedef struct orb_match {
  int is_found;  /* 0: a shape has too few vertices, or no map was found; nothing else is filled then */
  double cost;   /* of the best map: how much it bends, times 1 to 1 + ORB_FIND_TURN_COST for its rotation in space */
  double clear;  /* 0 to 1: how far the next best map that differs is behind */
  int32_t count; /* of pairs of vertices that correspond roughly; the ends of limbs come first */
  int32_t first[ORB_MATCH_PAIRS], second[ORB_MATCH_PAIRS];
  double *target; /* where each vertex of the second shape lies on the first one, in its space: 3 a vertex */
} orb_match;

/* Free `out` in any case. About 1 s of one thread, whatever the size; trials run on all threads, and the result has the
 * same bytes for any number of them. */
ORB_MUST_CHECK orb_status orb_match_find(orb_context *ctx, const orb_mesh *first, const orb_mesh *second,
                                         orb_match *out);
void orb_match_free(orb_context *ctx, orb_match *match);

#endif
