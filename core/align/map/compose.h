/* The composed map: lowering the distortion of the map from one shape straight to another, rather than that of each
 * shape's own embedding. See compose.c for the method. */
#ifndef ORB_ALIGN_MAP_COMPOSE_H
#define ORB_ALIGN_MAP_COMPOSE_H

#include "orbmorph/align.h"
#include "orbmorph/remesh.h"

/* Composed energies below it say that shapes correspond: no further start is tried. */
static const double ORB_MAP_GOOD_ENERGY = 1.2;

/* What the first spatial targets of a composed map follow. */
typedef enum orb_map_from {
  ORB_MAP_FROM_SPACE, /* what fits best in space */
  ORB_MAP_FROM_MAP,   /* the map as given, which is roughly right */
  ORB_MAP_SPACE_ONLY, /* what fits best in space; and where nothing comes of that, no more is tried */
  ORB_MAP_SPACE_DONE, /* what fits best in space, but for what ORB_MAP_SPACE_ONLY has tried already */
  ORB_MAP_MAP_ONLY    /* none: the map as given is improved where it is, roughly and at little cost */
} orb_map_from;

/* Improves the points of `moving` on the sphere so that the map moving → sphere → fixed is as isometric as can be. The
 * landmarks (vertices of both, whose points are bit-equal already) stay together. both: the fixed shape's points may
 * change too, which leaves more room, and the shapes may change places; else they stay, for further shapes. The result
 * is certified and better than what was given, or else all points are left as they are and *improved is 0. energy[2]:
 * composed symmetric Dirichlet, capped at 20 and weighted by area, before and after. Stage "align". */
ORB_MUST_CHECK orb_status orb_compose(orb_context *ctx, orb_aligned_shape *fixed, orb_aligned_shape *moving, int both,
                                      int32_t landmark_count, orb_map_from from, orb_preset preset, double energy[2],
                                      int *improved);

#endif
