#include "align/map/starts/shift.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/vec3.h"

enum { CHECK_EVERY = 1024 }; /* vertices between checks for cancellation; a power of two */

/* Where the best map takes a vertex. */
static void image_of(const orb_map_run *c, int32_t v, double y[3]) {
  orb_place place;
  orb_locate(c->b.locator, c->best + 3 * (size_t)v, -1, &place);
  orb_map_surface_at(&c->b, &place, y, NULL, NULL);
}

/* The ways of the landmarks to their partners, 3 each. */
static void measure_ways(const orb_map_run *c, double *way) {
  for (int32_t i = 0; i < c->pairs.landmarks; i++) {
    image_of(c, c->pairs.moving[i], way + 3 * (size_t)i);
    orb_sub(c->b.x + 3 * (size_t)c->pairs.fixed[i], way + 3 * (size_t)i, way + 3 * (size_t)i);
  }
}

/* How far vertex v is shifted: the mean of the ways, weighted by how near each landmark is; less where none is. */
static int shift_of(const orb_map_run *c, int32_t v, const double *way, double out[3]) {
  const orb_map_params *p = &c->params;
  double sum = 0;
  memset(out, 0, sizeof(double[3]));
  for (int32_t i = 0; i < c->pairs.landmarks; i++) {
    const double *w = way + 3 * (size_t)i;
    const double reach = fmax(p->shift.reach * orb_length(w), p->shift.least);
    const double far2 = orb_distance2(c->x + 3 * (size_t)v, c->x + 3 * (size_t)c->pairs.moving[i]);
    const double near = 1 - far2 / (reach * reach);
    for (int k = 0; k < 3 && near > 0; k++) {
      out[k] += near * near * w[k];
    }
    sum += near > 0 ? near * near : 0;
  }
  for (int k = 0; k < 3; k++) {
    out[k] /= fmax(1, sum);
  }
  return sum > 0;
}

double orb_map_longest_way(const orb_map_run *c) {
  double longest2 = 0;
  for (int32_t i = 0; i < c->pairs.landmarks; i++) {
    double y[3];
    image_of(c, c->pairs.moving[i], y);
    longest2 = fmax(longest2, orb_distance2(c->b.x + 3 * (size_t)c->pairs.fixed[i], y));
  }
  return sqrt(longest2);
}

orb_status orb_map_shift(orb_map_run *c, double share) {
  orb_nearest *tree = NULL;
  double *way = ORB_NEW(c->ctx, double, 3 * (size_t)c->pairs.landmarks);
  orb_status status = ORB_E_NO_MEMORY;
  if (!way) {
    goto done;
  }
  ORB_GO(status, orb_nearest_create(c->ctx, c->b.x, c->b.triangles, c->b.triangle_count, &tree), done);
  measure_ways(c, way);
  memcpy(c->start, c->best, 3 * (size_t)c->vertex_count * sizeof *c->start);
  for (int32_t v = 0; v < c->vertex_count && status == ORB_OK; v++) {
    double shift[3], y[3];
    if (shift_of(c, v, way, shift)) {
      orb_place place;
      image_of(c, v, y);
      for (int k = 0; k < 3; k++) {
        y[k] += share * shift[k];
      }
      orb_nearest_query(tree, y, INFINITY, &place);
      orb_map_surface_at(&c->b, &place, NULL, c->start + 3 * (size_t)v, NULL);
    }
    status = (v & (CHECK_EVERY - 1)) == CHECK_EVERY - 1 ? orb_context_check(c->ctx) : ORB_OK;
  }
  for (int32_t i = 0; i < c->pairs.landmarks && share == 1; i++) {
    memcpy(c->start + 3 * (size_t)c->pairs.moving[i], c->b.s + 3 * (size_t)c->pairs.fixed[i], sizeof(double[3]));
  }
done:
  orb_nearest_destroy(c->ctx, tree);
  orb_free(c->ctx, way);
  return status;
}
