/* Tip maps by rotations in space.
 *
 * Distances along the surface mislead where proportions differ: in a stout animal with a large head and a lean one, the
 * legs of one side are as far from each other as head and foreleg are, and dozens of wrong maps agree better than the
 * right one. But limbs mostly point the same way once one shape is rotated to face like the other. So the search starts
 * from each of 24 rotations, matches tips whose directions from the centre of the surface are nearly the same, fits the
 * rotation to the matched directions, and repeats both until nothing changes: iterative closest points (Besl & McKay
 * 1992) on directions. It tries rotations only, so no map is a mirror image.
 */
#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/find/tip_choice.h"
#include "align/find/tip_rotations.h"
#include "align/rotate/procrustes.h"
#include "base/check.h"
#include "numeric/vec3.h"

/* The i-th of the 24 rotations that map the axes to each other. */
static void side(int i, double r[9]) {
  int first = i / 8, second = (first + 1 + i / 4 % 2) % 3;
  double x[3] = {0}, y[3] = {0};
  x[first] = i & 1 ? -1 : 1;
  y[second] = i & 2 ? -1 : 1;
  memcpy(r, x, sizeof x);
  memcpy(r + 3, y, sizeof y);
  orb_cross(x, y, r + 6);
}

static void directions(const orb_mesh *mesh, const orb_tips *tips, double (*out)[3]) {
  orb_tips_from_middle(mesh, tips, out);
  for (int32_t i = 0; i < tips->count; i++) {
    orb_normalize(out[i]);
  }
}

static int match(const orb_tips tips[2], double (*at)[ORB_TIPS_MAX][3], const double rotation[9], orb_tip_map *map) {
  double beside[ORB_TIPS_MAX][ORB_TIPS_MAX];
  for (int32_t i = 0; i < tips[0].count; i++) {
    double p[3];
    orb_rotate_point(rotation, at[0][i], p);
    for (int32_t k = 0; k < tips[1].count; k++) {
      double angle = acos(fmin(1, fmax(-1, orb_dot(p, at[1][k])))) / ORB_FIND_DIRECTIONS_APART;
      beside[i][k] = 1 - angle * angle;
    }
  }
  return orb_tip_map_beside(&tips[0], &tips[1], beside, map);
}

static orb_status fit(orb_context *ctx, double (*at)[ORB_TIPS_MAX][3], int32_t count, const orb_tip_map *map,
                      double rotation[9]) {
  double c[9] = {0};
  for (int32_t i = 0; i < count; i++) {
    if (map->to[i] >= 0) {
      orb_add_outer(c, at[0][i], at[1][map->to[i]], 1);
    }
  }
  return orb_procrustes_covariance(ctx, c, rotation, NULL);
}

static void keep(const orb_tip_map *map, int32_t tip_count, orb_tip_map *list, int32_t *count) {
  int32_t at = 0;
  for (int32_t i = 0; i < *count; i++) {
    if (memcmp(list[i].to, map->to, (size_t)tip_count * sizeof *map->to) == 0) {
      return;
    }
    at += list[i].score >= map->score;
  }
  memmove(list + at + 1, list + at, (size_t)(*count - at) * sizeof *list);
  list[at] = *map;
  ++*count;
}

orb_status orb_tip_maps_by_rotation(orb_context *ctx, const orb_mesh *const meshes[2], const orb_tips tips[2],
                                    orb_tip_map out[ORB_TIP_ROTATIONS], int32_t *count) {
  double at[2][ORB_TIPS_MAX][3];
  *count = 0;
  for (int s = 0; s < 2; s++) {
    directions(meshes[s], &tips[s], at[s]);
  }
  for (int i = 0; i < ORB_TIP_ROTATIONS; i++) {
    double rotation[9];
    orb_tip_map map, last;
    side(i, rotation);
    int found = match(tips, at, rotation, &map), same = 0;
    for (int step = 0; step < ORB_FIND_STEPS && found && !same; step++) {
      ORB_TRY(orb_context_check(ctx)); /* matching tries up to 1.4 million maps */
      last = map;
      ORB_TRY(fit(ctx, at, tips[0].count, &map, rotation));
      found = match(tips, at, rotation, &map);
      same = found && memcmp(last.to, map.to, (size_t)tips[0].count * sizeof *map.to) == 0;
    }
    if (found) {
      keep(&map, tips[0].count, out, count);
    }
    ORB_TRY(orb_context_check(ctx));
  }
  return ORB_OK;
}
