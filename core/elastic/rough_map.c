#include "elastic/rough_map.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/rotation.h"
#include "numeric/vec3.h"

/* Lengths are those of surfaces of area 4π. Chosen by trial on the pairs of the half `choose` of
 * tests/bench/correspond.py, unless a line gives another reason. */
enum { MAP_ROUNDS = 2 }; /* along the rough map alone; 8 change little */
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

/* What the first rotation of a vertex is made of, in sums over its surroundings: mass, mass · x and mass · y, where y
 * is the image of x; mass · y xᵀ by rows; and the same of normals. */
enum { MASS, GIVEN, IMAGE = GIVEN + 3, OUTER = IMAGE + 3, MOMENTS = OUTER + 9 };

static void fill_moments(const orb_registration *r, double *moment) {
  memset(moment, 0, MOMENTS * (size_t)r->a.count * sizeof *moment);
  for (int32_t v = 0; v < r->a.count; v++, moment += MOMENTS) {
    const double mass = r->a.mass[v];
    const size_t at = 3 * (size_t)v, to = 3 * (size_t)r->map->forth[v];
    const double *x = r->a.mesh->positions + at, *y = r->b.mesh->positions + to;
    moment[MASS] = mass;
    for (int k = 0; k < 3; k++) {
      moment[GIVEN + k] = mass * x[k];
      moment[IMAGE + k] = mass * y[k];
    }
    orb_add_outer(moment + OUTER, y, x, mass);
    orb_add_outer(moment + OUTER, r->b.normal + to, r->a.normal + at, NORMAL_SHARE * mass);
  }
}

/* The rotation that carries these vertices best onto their images under the rough map. */
static void rotation_of_map(const double *moment, const int32_t *list, int32_t count, double rotation[9]) {
  double sum[MOMENTS] = {0};
  for (int32_t i = 0; i < count; i++) {
    const double *one = moment + MOMENTS * (size_t)list[i];
    for (int k = 0; k < MOMENTS; k++) {
      sum[k] += one[k];
    }
  }
  orb_add_outer(sum + OUTER, sum + IMAGE, sum + GIVEN, -1 / sum[MASS]);
  (void)orb_nearest_rotation(sum + OUTER, rotation);
}

/* Sets the pose that the rough map gives directly. */
static orb_status begin_from_map(orb_registration *r) {
  const int32_t n = r->a.count, most = orb_surroundings_most(n);
  const orb_surroundings *known = r->surroundings;
  int32_t *own = ORB_NEW(r->ctx, int32_t, most), *mark = ORB_NEW0(r->ctx, int32_t, n);
  double *moment = ORB_NEW(r->ctx, double, MOMENTS *(size_t)n);
  const orb_status status = own && mark && moment ? ORB_OK : ORB_E_NO_MEMORY;
  if (status == ORB_OK) {
    fill_moments(r, moment);
  }
  for (int32_t v = 0; v < n && status == ORB_OK; v++) {
    const int32_t *list = known ? known->list + (size_t)v * (size_t)known->most : own;
    const int32_t count = known ? known->size[v] : orb_surroundings_list(&r->a, v, most, mark, own);
    rotation_of_map(moment, list, count, r->pose->rotation + 9 * (size_t)v);
    memcpy(r->pose->position + 3 * (size_t)v, r->b.mesh->positions + 3 * (size_t)r->map->forth[v], sizeof(double[3]));
  }
  orb_free(r->ctx, own);
  orb_free(r->ctx, mark);
  orb_free(r->ctx, moment);
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
