/* Tips of limbs, and how those of two shapes may belong together. */
#ifndef ORB_ALIGN_TIPS_H
#define ORB_ALIGN_TIPS_H

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

/* Tip i of the first shape is tip to[i] of the second, −1: none. */
typedef struct orb_tip_map {
  int32_t count, to[ORB_TIPS_MAX];
  double score; /* how well distances, or directions, agree, summed over tips and pairs of them */
} orb_tip_map;

/* The maps of at least three tips whose distances agree best, best first; none is a part of another. Which way round
 * they turn is not looked at: mirror images are among them. */
void orb_tip_maps(const orb_tips *a, const orb_tips *b, orb_tip_map out[ORB_TIP_MAPS_MAX], int32_t *count);

/* Of these maps, best first, at most `most` that are worth a trial: by turns from each way round in space that the tips
 * can be fitted, those whose tips fit best first, none that a mirror image would fit clearly better. chosen: indices.
 */
ORB_MUST_CHECK orb_status orb_tip_maps_choose(orb_context *ctx, const orb_mesh *const meshes[2], const orb_tips tips[2],
                                              const orb_tip_map *maps, int32_t count, int32_t most, int32_t *chosen,
                                              int32_t *chosen_count);

/* The one map of at least three tips of which most tips lie beside each other, with distances that agree. beside: 1
 * at the same place, not positive: not to be matched. 0: there is none. */
int orb_tip_map_beside(const orb_tips *a, const orb_tips *b, double (*beside)[ORB_TIPS_MAX], orb_tip_map *out);

/* The maps that come of turning one shape onto the other in space, best first, see tip_turns.c. They are few, and all
 * worth a trial. */
ORB_MUST_CHECK orb_status orb_tip_maps_by_turns(orb_context *ctx, const orb_mesh *const meshes[2],
                                                const orb_tips tips[2], orb_tip_map out[ORB_TIP_TURNS], int32_t *count);

/* Where tips are, seen from the middle of the surface by area: tips->count points. */
void orb_tips_from_middle(const orb_mesh *mesh, const orb_tips *tips, double (*out)[3]);

#endif
