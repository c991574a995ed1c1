/* Which tip maps are worth a trial.
 *
 * The maps whose distances agree best are mostly one map and its small variations: legs change places among themselves,
 * and a map that swaps front and back comes only after dozens of them. So maps are grouped by the rotation in space
 * that fits the tips of the second shape, as seen from the centre of the surface, and the groups take turns, best map
 * first. Within a group, maps whose tips fit count more. A map that a mirror image fits clearly better would turn the
 * surface inside out; it is left out.
 */
#include <math.h>
#include <string.h>

#include "align/find/params.h"
#include "align/find/tip_choice.h"
#include "align/rotate/procrustes.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

typedef struct group {
  double rotation[9];
  int32_t taken;
} group;

typedef struct candidate {
  double value;
  int32_t group; /* −1: left out */
} candidate;

/* The centre of area of the surface. */
static void middle_of(const orb_mesh *mesh, double out[3]) {
  double total = 0, sum[3] = {0};
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    const double *p[3];
    double u[3], w[3], n[3];
    for (int k = 0; k < 3; k++) {
      p[k] = mesh->positions + 3 * (size_t)mesh->triangles[3 * (size_t)t + (size_t)k];
    }
    orb_sub(p[1], p[0], u);
    orb_sub(p[2], p[0], w);
    orb_cross(u, w, n);
    double area = orb_length(n);
    total += area;
    for (int k = 0; k < 3; k++) {
      sum[k] += area * (p[0][k] + p[1][k] + p[2][k]) / 3;
    }
  }
  for (int k = 0; k < 3; k++) {
    out[k] = total > 0 ? sum[k] / total : 0;
  }
}

void orb_tips_from_middle(const orb_mesh *mesh, const orb_tips *tips, double (*out)[3]) {
  double middle[3];
  middle_of(mesh, middle);
  for (int32_t i = 0; i < tips->count; i++) {
    orb_sub(mesh->positions + 3 * (size_t)tips->vertex[i], middle, out[i]);
  }
}

/* The rotation that fits the tips best, and how well: 1 where they are similar. *mirror: the gain of a reflection. */
static orb_status fit(orb_context *ctx, double (*a)[3], double (*b)[3], int32_t count, const orb_tip_map *map,
                      double rotation[9], double *value, double *mirror) {
  double c[9] = {0}, singular[3], aa = 0, bb = 0;
  for (int32_t i = 0; i < count; i++) {
    if (map->to[i] >= 0) {
      const double *p = a[i], *q = b[map->to[i]];
      aa += orb_dot(p, p);
      bb += orb_dot(q, q);
      orb_add_outer(c, p, q, 1);
    }
  }
  ORB_TRY(orb_procrustes_covariance(ctx, c, rotation, singular));
  double scale = aa > 0 && bb > 0 ? 1 / sqrt(aa * bb) : 0;
  *value = (singular[0] + singular[1] + singular[2]) * scale;
  *mirror = singular[2] < 0 ? -2 * singular[2] * scale : 0;
  return ORB_OK;
}

static int is_same_group(const double x[9], const double y[9]) {
  double trace = 0;
  for (int k = 0; k < 9; k++) {
    trace += x[k] * y[k];
  }
  return trace > 1 + 2 * cos(ORB_FIND_SAME_GROUP);
}

/* The best map of a group from which the fewest were taken; −1: none is left. */
static int32_t take_next(const candidate *list, const group *groups, int32_t count) {
  int32_t best = -1;
  for (int32_t i = 0; i < count; i++) {
    if (list[i].group < 0) {
      continue;
    }
    int32_t taken = groups[list[i].group].taken, least = best < 0 ? taken : groups[list[best].group].taken;
    best = best < 0 || taken < least || (taken == least && list[i].value > list[best].value) ? i : best;
  }
  return best;
}

orb_status orb_tip_maps_choose(orb_context *ctx, const orb_mesh *const meshes[2], const orb_tips tips[2],
                               const orb_tip_map *maps, int32_t count, int32_t most, int32_t *chosen,
                               int32_t *chosen_count) {
  double at[2][ORB_TIPS_MAX][3], rotation[9], value, mirror;
  orb_status status = ORB_OK;
  int32_t group_count = 0;
  group *groups = ORB_NEW0(ctx, group, (size_t)count + 1);
  candidate *list = ORB_NEW0(ctx, candidate, (size_t)count + 1);
  *chosen_count = 0;
  if (!groups || !list) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int s = 0; s < 2; s++) {
    orb_tips_from_middle(meshes[s], &tips[s], at[s]);
  }
  for (int32_t i = 0; i < count; i++) {
    ORB_GO(status, fit(ctx, at[0], at[1], tips[0].count, &maps[i], rotation, &value, &mirror), end);
    list[i].group = -1;
    if (mirror > ORB_FIND_MIRRORED || !(maps[i].score > 0)) {
      continue;
    }
    int32_t w = 0;
    while (w < group_count && !is_same_group(rotation, groups[w].rotation)) {
      w++;
    }
    if (w == group_count) {
      memcpy(groups[group_count++].rotation, rotation, sizeof rotation);
    }
    list[i] = (candidate){maps[i].score * fmax(value, ORB_FIND_LEAST_FIT), w};
  }
  for (int32_t i; *chosen_count < most && (i = take_next(list, groups, count)) >= 0;) {
    chosen[(*chosen_count)++] = i;
    groups[list[i].group].taken++;
    list[i].group = -1;
  }
end:
  orb_free(ctx, groups);
  orb_free(ctx, list);
  return status;
}
