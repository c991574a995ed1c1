/* Tips of limbs. */
#ifndef ORB_ALIGN_FIND_TIPS_H
#define ORB_ALIGN_FIND_TIPS_H

#include "orbmorph/mesh.h"

enum {
  ORB_TIPS_MAX = 8,       /* all maps of eight tips are 1.4 million (tip_maps.c), more would take too long */
  ORB_TIP_MAPS_MAX = 256, /* of all maps, the best that are kept */
  ORB_TIP_ROTATIONS = 24  /* rotations of a cube, from which a search in space starts */
};

/* Vertices that are farther from the rest of the surface than all vertices around them, farthest first. Distances run
 * along the surface, in units of the mean distance between two of its points. */
typedef struct orb_tips {
  int32_t count, vertex[ORB_TIPS_MAX];
  double far[ORB_TIPS_MAX]; /* mean distance from the rest */
  double distance[ORB_TIPS_MAX][ORB_TIPS_MAX];
} orb_tips;

/* O(sources · n log n): for meshes of a few thousand vertices. */
ORB_MUST_CHECK orb_status orb_tips_find(orb_context *ctx, const orb_mesh *mesh, orb_tips *out);

#endif
