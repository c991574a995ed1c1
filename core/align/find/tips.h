/* Tips of limbs, and how those of two shapes may belong together. */
#ifndef ORB_ALIGN_FIND_TIPS_H
#define ORB_ALIGN_FIND_TIPS_H

#include "orbmorph/mesh.h"

enum { ORB_TIPS_MAX = 8, ORB_TIP_MAPS_MAX = 256, ORB_TIP_TURNS = 24 };

/* Vertices that are farther from the rest of the surface than all about them, farthest first. Distances go along the
 * surface, in units of the mean distance between any two points of it. */
typedef struct orb_tips {
  int32_t count, vertex[ORB_TIPS_MAX];
  double far[ORB_TIPS_MAX]; /* from the rest, in the mean */
  double distance[ORB_TIPS_MAX][ORB_TIPS_MAX];
} orb_tips;

/* O(sources · n log n): for meshes of a few thousand vertices. */
ORB_MUST_CHECK orb_status orb_tips_find(orb_context *ctx, const orb_mesh *mesh, orb_tips *out);

#endif
