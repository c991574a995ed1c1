/* Alignment without landmarks: several correspondences are tried on coarse copies of two shapes, and the best is told
 * by the energy of its composed map. See guess.c. */
#ifndef ORB_ALIGN_FIND_GUESS_H
#define ORB_ALIGN_FIND_GUESS_H

#include "align/sheet/sheet.h"

enum { ORB_GUESS_MAX = 12 };

/* What the trials on two shapes came to. */
typedef struct orb_guess {
  int32_t count; /* of pairs; 0: nothing is better than what the rotation search finds */
  int32_t first[ORB_GUESS_MAX], second[ORB_GUESS_MAX]; /* vertices of the given meshes that belong together */
  double energy;                                       /* of the best correspondence, composed on the coarse copies */
  double clear; /* 0 to 1: how far behind the next best correspondence is that differs */
} orb_guess;

ORB_MUST_CHECK orb_status orb_guess_find(orb_context *ctx, const orb_mesh *a, const orb_mesh *b, orb_guess *out);

#endif
