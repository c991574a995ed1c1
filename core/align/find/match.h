/* Which points of two shapes correspond, by rough maps, ranked by how much they bend the shapes. Landmarks, where there
 * are any, only exclude maps.
 *
 * Comes in: two meshes. Goes out: where each vertex of the second lies on the first. Read in this order:
 *
 *   hint.h    what landmarks say of a match
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

#include "align/find/hint.h"

enum {
  ORB_MATCH_PAIRS = 12, /* most pairs of a match */
  ORB_MATCH_OTHERS = 4  /* most maps that are listed beside the best one */
};

/* Pairs of vertices that correspond roughly; the ends of limbs come first. */
typedef struct orb_match_pairs {
  int32_t count;
  int32_t first[ORB_MATCH_PAIRS], second[ORB_MATCH_PAIRS];
} orb_match_pairs;

typedef struct orb_match_other {
  double cost; /* as a multiple of the best map's: at least 1. From one direction alone where that dropped the map */
  orb_match_pairs pairs;
} orb_match_other;

typedef struct orb_match_search orb_match_search; /* match.c */

typedef struct orb_match {
  int is_found; /* 0: a shape has too few vertices, or no map was found; nothing else is filled then */
  double bend;  /* how much the best map bends, the mean of both directions: 0 for a rigid motion */
  double cost;  /* its bend, times 1 to 1 + ORB_FIND_TURN_COST for its rotation in space */
  double clear; /* 0 to 1: how far the next best map that differs is behind */
  orb_match_pairs pairs;
  int32_t other_count; /* maps that differ from the best one and from each other by more than ORB_FIND_DIFFERENT */
  orb_match_other other[ORB_MATCH_OTHERS]; /* by rising cost */
  double *target;           /* where each vertex of the second shape lies on the first one, in its space: 3 a vertex */
  orb_match_search *search; /* the candidates, for the two functions below */
} orb_match;

/* hint: NULL, or landmarks: then there is a match only if they say that the shapes are one in two poses, and only maps
 * that take them near their partners count. Free `out` in any case. About 1 s of one thread, whatever the size; trials
 * run on all threads, and the result has the same bytes for any number of them. */
ORB_MUST_CHECK orb_status orb_match_find(orb_context *ctx, const orb_mesh *first, const orb_mesh *second,
                                         const orb_match_hint *hint, orb_match *out);
/* The target of other[k], which the caller frees: NULL on failure. The meshes of the match must still be there. About
 * 0.4 s of one thread. */
ORB_MUST_CHECK orb_status orb_match_other_target(orb_context *ctx, const orb_match *match, int32_t k, double **target);
/* Makes other[k] the best map, and the one that was best the first of the others. target: its own, which the match owns
 * from then on, also after a failure. clear: how far the other one is behind by what has decided. */
ORB_MUST_CHECK orb_status orb_match_choose(orb_context *ctx, orb_match *match, int32_t k, double *target, double clear);
/* The confidence in a match, 0 to 1, from its bend, its `clear` and the energy of the map that followed it: calibrated
 * from 0.8 on (docs/bench-confidence.md). */
double orb_match_confidence(double bend, double clear, double energy);
void orb_match_free(orb_context *ctx, orb_match *match);

#endif
