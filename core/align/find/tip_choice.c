/* Which maps of tips are worth a trial.
 *
 * The maps that agree best in their distances are mostly one map and its small variations: legs change places among
 * themselves, and another map that turns the shape front to back comes only after dozens of them. So they are sorted by
 * the way the second shape would have to be turned in space for its tips to fit, seen from the middle of the surface,
 * and are taken by turns from each such way round, the best first. Of maps about the same way round those count more
 * whose tips fit; maps that a mirror image would fit clearly better turn the surface inside out and are left out.
 */
#include <math.h>
#include <string.h>

#include "align/find/tip_choice.h"
#include "align/rotate/procrustes.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static const double SAME_WAY = 1;    /* radians between rotations that count as one */
static const double MIRRORED = 0.15; /* of the fit: a mirror image that gains more is the better one */
static const double LEAST_FIT = 0.1;

typedef struct way {
  double rotation[9];
  int32_t taken;
} way;

typedef struct candidate {
  double value;
  int32_t way; /* −1: left out */
} candidate;

/* By area, of the surface. */
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

/* The rotation that fits the tips best, and how well: 1 where they are similar. *mirror: how much better a reflection
 * fits. */
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

static int is_same_way(const double x[9], const double y[9]) {
  double trace = 0;
  for (int k = 0; k < 9; k++) {
    trace += x[k] * y[k];
  }
  return trace > 1 + 2 * cos(SAME_WAY);
}

/* Takes the best of a way that was taken from least; −1: nothing is left. */
static int32_t take_next(const candidate *list, const way *ways, int32_t count) {
  int32_t best = -1;
  for (int32_t i = 0; i < count; i++) {
    if (list[i].way < 0) {
      continue;
    }
    int32_t taken = ways[list[i].way].taken, least = best < 0 ? taken : ways[list[best].way].taken;
    best = best < 0 || taken < least || (taken == least && list[i].value > list[best].value) ? i : best;
  }
  return best;
}

orb_status orb_tip_maps_choose(orb_context *ctx, const orb_mesh *const meshes[2], const orb_tips tips[2],
                               const orb_tip_map *maps, int32_t count, int32_t most, int32_t *chosen,
                               int32_t *chosen_count) {
  double at[2][ORB_TIPS_MAX][3], rotation[9], value, mirror;
  orb_status status = ORB_OK;
  int32_t way_count = 0;
  way *ways = ORB_NEW0(ctx, way, (size_t)count + 1);
  candidate *list = ORB_NEW0(ctx, candidate, (size_t)count + 1);
  *chosen_count = 0;
  if (!ways || !list) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  for (int s = 0; s < 2; s++) {
    orb_tips_from_middle(meshes[s], &tips[s], at[s]);
  }
  for (int32_t i = 0; i < count; i++) {
    ORB_GO(status, fit(ctx, at[0], at[1], tips[0].count, &maps[i], rotation, &value, &mirror), end);
    list[i].way = -1;
    if (mirror > MIRRORED || !(maps[i].score > 0)) {
      continue;
    }
    int32_t w = 0;
    while (w < way_count && !is_same_way(rotation, ways[w].rotation)) {
      w++;
    }
    if (w == way_count) {
      memcpy(ways[way_count++].rotation, rotation, sizeof rotation);
    }
    list[i] = (candidate){maps[i].score * fmax(value, LEAST_FIT), w};
  }
  for (int32_t i; *chosen_count < most && (i = take_next(list, ways, count)) >= 0;) {
    chosen[(*chosen_count)++] = i;
    ways[list[i].way].taken++;
    list[i].way = -1;
  }
end:
  orb_free(ctx, ways);
  orb_free(ctx, list);
  return status;
}
