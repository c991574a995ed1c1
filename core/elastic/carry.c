#include "elastic/carry.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/parallel.h"
#include "numeric/vec3.h"

enum { GRAIN = 128 }; /* points of one task */

/* Carries one point: each corner of its place rotates and shifts it, and the coordinates blend the three. */
static void carry_point(const orb_mesh *coarse, const orb_elastic_pose *pose, const orb_place *place, const double p[3],
                        double out[3]) {
  memset(out, 0, sizeof(double[3]));
  for (int k = 0; k < 3; k++) {
    size_t u = (size_t)coarse->triangles[3 * (size_t)place->triangle + (size_t)k];
    double e[3];
    orb_sub(p, coarse->positions + 3 * u, e);
    for (int i = 0; i < 3; i++) {
      out[i] += place->at[k] * (pose->position[3 * u + (size_t)i] + orb_dot(pose->rotation + 9 * u + 3 * i, e));
    }
  }
}

typedef struct carrying {
  const orb_mesh *coarse;
  const orb_elastic_pose *pose;
  const double *points;
  orb_nearest *tree;
  orb_elastic_pose *out;
} carrying;

static void carry_range(void *arg, int64_t begin, int64_t end, int thread) {
  const carrying *c = arg;
  (void)thread;
  for (int64_t v = begin; v < end; v++) {
    orb_place place;
    const double *p = c->points + 3 * v;
    (void)orb_nearest_query(c->tree, p, INFINITY, &place);
    carry_point(c->coarse, c->pose, &place, p, c->out->position + 3 * v);
    if (c->out->rotation) {
      int most = place.at[1] > place.at[0] ? 1 : 0;
      most = place.at[2] > place.at[most] ? 2 : most;
      int32_t u = c->coarse->triangles[3 * (size_t)place.triangle + (size_t)most];
      memcpy(c->out->rotation + 9 * v, c->pose->rotation + 9 * (size_t)u, sizeof(double[9]));
    }
  }
}

orb_status orb_elastic_carry(orb_context *ctx, const orb_mesh *coarse, const orb_elastic_pose *pose,
                             const double *points, int32_t count, orb_elastic_pose *out) {
  carrying c = {.coarse = coarse, .pose = pose, .points = points, .out = out};
  ORB_TRY(orb_nearest_create(ctx, coarse->positions, coarse->triangles, coarse->triangle_count, &c.tree));
  orb_parallel_for(ctx, count, GRAIN, carry_range, &c);
  orb_nearest_destroy(ctx, c.tree);
  return ORB_OK;
}
