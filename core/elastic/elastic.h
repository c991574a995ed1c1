/* Non-rigid registration of one surface to another, as rigid as possible.
 *
 * In: two meshes, the first one of up to ten thousand vertices or so, and a rough map between them or places where the
 * first one lies already. Out: where the first one goes so that it lies on the second, and how much that bends it. A
 * rough map of the right limbs bends little, even if it misses their tips by a little. A map of the wrong limbs bends
 * much. So the cost ranks maps. Read in this order:
 *
 *   searched.h  vertices, laid out for searches of the nearest one
 *   body.h      a mesh with what the steps read
 *   stretch.h   how the surroundings of a vertex are stretched
 *   relief.h    how far a vertex stands out from its surroundings
 *   elastic.h   the registration
 *   carry.h     its pose, for other points
 *
 * Source: Sorkine & Alexa 2007 (as-rigid-as-possible energy: rotations of vertices and positions take turns), with
 * iterative closest points (Besl & McKay 1992) in both directions.
 */
#ifndef ORB_ELASTIC_ELASTIC_H
#define ORB_ELASTIC_ELASTIC_H

#include "orbmorph/mesh.h"

/* A rough map between two meshes, both ways: for each vertex of one, a vertex of the other. */
typedef struct orb_rough_map {
  const int32_t *forth; /* of the second mesh, for each vertex of the first */
  const int32_t *back;  /* of the first mesh, for each vertex of the second */
} orb_rough_map;

/* A point of the first mesh that belongs at a place of the second one. */
typedef struct orb_elastic_anchor {
  int32_t vertex;   /* of the first mesh, near the point */
  double offset[3]; /* from the vertex to the point, in the mesh as given */
  double place[3];  /* where the point belongs */
} orb_elastic_anchor;

/* A NULL pointer to them means none. */
typedef struct orb_elastic_anchors {
  int32_t count;
  const orb_elastic_anchor *one;
} orb_elastic_anchors;

/* Where the first mesh is. The caller owns both. */
typedef struct orb_elastic_pose {
  double *position; /* 3 per vertex */
  double *rotation; /* 9 per vertex, row-major: of its surroundings, from the mesh as given */
} orb_elastic_pose;

/* Moves mesh a to mesh b along a rough map, then to the nearest places, and its anchors, if any, to theirs. Both meshes
 * are scaled to the same area, near 4π, and have no vertex without triangles. Fills the pose. *bend: mean squared
 * change of the edges of a against the rotations of their ends, relative to their squared lengths. O(n · m) a round, 8
 * rounds, and O(n²) before them: about 0.015 s for two meshes of a thousand vertices. One thread; may run beside others
 * in loops of the context. */
ORB_MUST_CHECK orb_status orb_elastic_register(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                                               const orb_rough_map *map, const orb_elastic_anchors *anchors,
                                               orb_elastic_pose *pose, double *bend);

/* Moves mesh a to the nearest places of mesh b, and its anchors to theirs, from a pose near them, in so many rounds, at
 * least 2. Changes the pose. On all threads. */
ORB_MUST_CHECK orb_status orb_elastic_settle(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                                             const orb_elastic_anchors *anchors, int rounds, orb_elastic_pose *pose);

/* Slides mesh a over mesh b until the two fit each other in space, from where a map takes its vertices. A map of little
 * energy knows lengths only; a slide knows bumps and hollows as well. Both meshes are as in orb_elastic_register().
 * Changes the positions, 3 per vertex. O(n · m) a round, 10 to 40 rounds, as long as it moves. On all threads. */
ORB_MUST_CHECK orb_status orb_elastic_slide(orb_context *ctx, const orb_mesh *a, const orb_mesh *b,
                                            const orb_elastic_anchors *anchors, double *position);

#endif
