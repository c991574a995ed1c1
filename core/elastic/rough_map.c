#include "elastic/rough_map.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

/* Lengths are those of surfaces of area 4π. Chosen by trial on the pairs of the half `choose` of
 * tests/bench/correspond.py, unless a line gives another reason. */
enum {
  MAP_ROUNDS = 2,  /* along the rough map alone; 8 change little */
  SURROUNDINGS = 4 /* a vertex takes its first rotation from the images of its surroundings, one vertex in this many of
                      the mesh. With one in 16, a limb's girth and as much of its length, noise of the rough map stays
                      as twists: of 20 pairs, the right map then bends the shapes least in 17 instead of 19, and by a
                      tenth more */
};
/* Distance at which a pull is as strong as the edges. A rough map is off by 0.2 or more at the ends of limbs. */
static const double MAP_REACH = 0.6;
/* Distances at which a vertex of the rough map is an outlier and counts a quarter: at first, and in these rounds. */
static const double OUTLIER_FIRST = 10, OUTLIER_MAP = 0.6;
static const double NORMAL_SHARE = 0.05; /* of normals beside positions in a first rotation: a limb is nearly a line */

double orb_rough_map_reach2(void) {
  return MAP_REACH * MAP_REACH;
}

void orb_pull_by_rough_map(orb_registration *r, double weight, double outlier) {
  for (int back = 0; back < 2; back++) {
    const orb_body *from = back ? &r->b : &r->a;
    const int32_t *to = back ? r->map->back : r->map->forth;
    for (int32_t i = 0; i < from->count; i++) {
      int32_t v = back ? to[i] : i, u = back ? i : to[i];
      const double *y = r->b.mesh->positions + 3 * (size_t)u;
      double far = orb_distance2(y, r->pose->position + 3 * (size_t)v), share = 1 / (1 + far / (outlier * outlier));
      orb_registration_pull(r, v, y, weight * from->mass[i] * share * share);
    }
  }
}

/* The vertices around v, nearest rings first: `most` of them, if there are as many. mark: a number per vertex. */
static int32_t list_surroundings(const orb_body *a, int32_t v, int32_t most, int32_t *mark, int32_t *list) {
  int32_t count = 1;
  list[0] = v;
  mark[v] = v + 1;
  for (int32_t k = 0; k < count; k++) {
    for (int32_t i = a->start[list[k]]; i < a->start[list[k] + 1] && count < most; i++) {
      if (mark[a->next[i]] != v + 1) {
        mark[a->next[i]] = v + 1;
        list[count++] = a->next[i];
      }
    }
  }
  return count;
}

/* The rotation that carries these vertices best onto their images under the rough map. */
static void rotation_of_map(const orb_registration *r, const int32_t *list, int32_t count, double rotation[9]) {
  double mean[2][3] = {{0}}, all = 0, h[9] = {0};
  const double *x = r->a.mesh->positions, *y = r->b.mesh->positions;
  for (int32_t k = 0; k < count; k++) {
    for (size_t i = 0; i < 3; i++) {
      mean[0][i] += r->a.mass[list[k]] * x[3 * (size_t)list[k] + i];
      mean[1][i] += r->a.mass[list[k]] * y[3 * (size_t)r->map->forth[list[k]] + i];
    }
    all += r->a.mass[list[k]];
  }
  for (int i = 0; i < 6; i++) {
    mean[i / 3][i % 3] /= all;
  }
  for (int32_t k = 0; k < count; k++) {
    size_t v = 3 * (size_t)list[k], u = 3 * (size_t)r->map->forth[list[k]];
    double p[3], q[3];
    orb_sub(x + v, mean[0], p);
    orb_sub(y + u, mean[1], q);
    orb_add_outer(h, q, p, r->a.mass[list[k]]);
    orb_add_outer(h, r->b.normal + u, r->a.normal + v, NORMAL_SHARE * r->a.mass[list[k]]);
  }
  (void)orb_nearest_rotation(h, rotation);
}

/* Sets the pose that the rough map gives directly. */
static orb_status begin_from_map(orb_registration *r) {
  const int32_t n = r->a.count, most = 1 + n / SURROUNDINGS;
  int32_t *list = ORB_NEW(r->ctx, int32_t, most), *mark = ORB_NEW0(r->ctx, int32_t, n);
  const orb_status status = list && mark ? ORB_OK : ORB_E_NO_MEMORY;
  for (int32_t v = 0; v < n && status == ORB_OK; v++) {
    const int32_t count = list_surroundings(&r->a, v, most, mark, list);
    rotation_of_map(r, list, count, r->pose->rotation + 9 * (size_t)v);
    memcpy(r->pose->position + 3 * (size_t)v, r->b.mesh->positions + 3 * (size_t)r->map->forth[v], sizeof(double[3]));
  }
  orb_free(r->ctx, list);
  orb_free(r->ctx, mark);
  return status;
}

orb_status orb_follow_rough_map(orb_registration *r) {
  ORB_TRY(begin_from_map(r));
  for (int i = 0; i < MAP_ROUNDS; i++) {
    orb_registration_clear(r);
    orb_pull_by_rough_map(r, 1 / orb_rough_map_reach2(), i == 0 ? OUTLIER_FIRST : OUTLIER_MAP);
    orb_registration_pull_by_anchors(r);
    ORB_TRY(orb_registration_solve(r, 1));
    orb_registration_fit(r);
  }
  return ORB_OK;
}
