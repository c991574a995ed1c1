/* Alignment without landmarks: which points of two shapes may correspond.
 *
 * Comes in: two meshes. Goes out: vertices of both that correspond under the best candidate. Read in this order:
 *
 *   tips.h           tips of limbs, and distances between them
 *   tip_maps.h       tip maps whose distances agree
 *   tip_choice.h     which of these are worth a trial
 *   tip_rotations.h  tip maps by rotations in space
 *   candidates.h     tip maps and spectral maps are tried on coarse copies and ranked by the energy of their composed
 *                    maps
 *   found.h          the landmarks that an alignment found, and their confidence
 *
 * params.h has all thresholds. auto.c decides by the energy of the first map whether to search (near_isometry and
 * others in map/engine/params.h).
 */
#ifndef ORB_ALIGN_FIND_CANDIDATES_H
#define ORB_ALIGN_FIND_CANDIDATES_H

#include "align/sheet/sheet.h"

enum { ORB_CANDIDATE_PAIRS = 12 }; /* most pairs of a candidate */

/* The best candidate for two shapes. */
typedef struct orb_candidate {
  int32_t count; /* of pairs; 0: no candidate is better than the rotation search */
  int32_t first[ORB_CANDIDATE_PAIRS], second[ORB_CANDIDATE_PAIRS]; /* vertices of the meshes that correspond */
  double energy;                                                   /* of its map, composed on the coarse copies */
  double clear;   /* 0 to 1: how far the next best candidate that differs is behind */
  int is_certain; /* 1: it is the map that the eigenfunctions single out; energies do not count against it */
} orb_candidate;

ORB_MUST_CHECK orb_status orb_candidate_find(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                                             orb_candidate *out);

#endif
