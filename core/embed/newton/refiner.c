#include "embed/newton/refiner.h"

#include <math.h>

#include "base/check.h"
#include "base/error.h"
#include "base/memory.h"
#include "embed/common/kernel.h"
#include "embed/newton/collapse.h"
#include "embed/newton/level.h"
#include "embed/newton/multires.h"
#include "embed/newton/star.h"
#include "embed/newton/vector/loops.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

enum { QUEUE_MOST = 65536 }; /* entries of the relaxation queue; a vertex that finds it full is not relaxed */

/* Puts the base on the sphere as a regular tetrahedron whose faces are positive. */
static void place_base(orb_refiner *r) {
  const orb_hierarchy *h = r->hierarchy;
  const orb_corner_table *s = &h->surface;
  const double a = 0.57735026918962576451; /* 1/√3 */
  const double corner[4][3] = {{a, a, a}, {a, -a, -a}, {-a, a, -a}, {-a, -a, a}};
  int32_t c = s->vertex_corner[h->base[0]];
  int32_t v[4] = {s->corner[c], s->corner[orb_corner_next(c)], s->corner[orb_corner_prev(c)], -1};
  for (int i = 0; i < 4; i++) {
    int32_t u = h->base[i];
    r->alive[u] = 1;
    if (u != v[0] && u != v[1] && u != v[2]) {
      v[3] = u;
    }
  }
  int reversed = orb_orient(corner[0], corner[1], corner[2]) < 0;
  for (int i = 0; i < 4; i++) {
    int at = reversed && i == 1 ? 2 : reversed && i == 2 ? 1 : i;
    memcpy(r->point + 4 * (int64_t)v[i], corner[at], sizeof corner[at]);
    (void)orb_normalize(r->point + 4 * (int64_t)v[i]);
  }
  r->live = 4;
}

static int in_range(double x, double low, double high) {
  return x >= low && x <= high;
}

orb_status orb_refiner_create(orb_context *ctx, orb_hierarchy *h, const orb_embed_options *options, orb_refiner **out) {
  ORB_ASSERT(h->undone == 0);
  if (!in_range(options->energy_weight, 0, 1e6)) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "energy_weight must lie between 0 and 1000000.");
  }
  if (options->preset < ORB_PRESET_DEFAULT || options->preset > ORB_PRESET_QUALITY) {
    return orb_fail(ctx, ORB_E_BAD_OPTION, "preset must be fast, default or quality.");
  }
  int64_t n = h->surface.vertex_count;
  orb_refiner *r = ORB_NEW0(ctx, orb_refiner, 1);
  if (!r) {
    return ORB_E_NO_MEMORY;
  }
  r->hierarchy = h;
  orb_newton_settings_of(options, &r->settings);
  r->star_count = orb_threads(ctx);
  r->point = ORB_NEW0(ctx, double, 4 * n);
  r->alive = ORB_NEW0(ctx, unsigned char, n);
  r->pinned = ORB_NEW0(ctx, unsigned char, n);
  r->queued = ORB_NEW0(ctx, unsigned char, n);
  r->queue_capacity = 64;
  while (r->queue_capacity < n && r->queue_capacity < QUEUE_MOST) {
    r->queue_capacity *= 2;
  }
  r->queue = ORB_NEW(ctx, int32_t, r->queue_capacity);
  r->crowding = ORB_NEW0(ctx, float, n);
  r->star = ORB_NEW0(ctx, orb_star, r->star_count);
  r->room = ORB_NEW0(ctx, orb_kernel_room, r->star_count);
  if (!r->point || !r->alive || !r->pinned || !r->queued || !r->queue || !r->crowding || !r->star || !r->room) {
    orb_refiner_destroy(ctx, r);
    return ORB_E_NO_MEMORY;
  }
  place_base(r);
  *out = r;
  return ORB_OK;
}

orb_status orb_refiner_resume(orb_context *ctx, const orb_mesh *mesh, const double *points,
                              const orb_embed_options *options, orb_hierarchy **hierarchy, orb_refiner **out) {
  orb_refiner *r = NULL;
  orb_hierarchy *h = ORB_NEW0(ctx, orb_hierarchy, 1);
  if (!h) {
    return ORB_E_NO_MEMORY;
  }
  h->loops = orb_vector_loops_of(orb_context_cpu(ctx));
  orb_status status;
  ORB_GO(status, orb_corner_table_create(ctx, mesh, &h->surface), done);
  const orb_corner_table *s = &h->surface;
  /* The four vertices around an edge serve as the base: every position is set below. */
  int32_t c = s->vertex_corner[0];
  h->base[0] = s->corner[c];
  h->base[1] = s->corner[orb_corner_next(c)];
  h->base[2] = s->corner[orb_corner_prev(c)];
  h->base[3] = s->corner[s->opposite[c]];
  ORB_GO(status, orb_refiner_create(ctx, h, options, &r), done);
  for (int32_t v = 0; v < s->vertex_count; v++) {
    r->alive[v] = 1;
    memcpy(r->point + 4 * (int64_t)v, points + 3 * (int64_t)s->to_mesh[v], 3 * sizeof(double));
  }
  r->live = s->vertex_count;
  *out = r;
  *hierarchy = h;
  return ORB_OK;
done:
  orb_hierarchy_destroy(ctx, h);
  return status;
}

void orb_refiner_destroy(orb_context *ctx, orb_refiner *r) {
  if (r) {
    orb_hierarchy *h = r->hierarchy;
    while (h->undone > 0) { /* back to the tetrahedron, for the next refiner */
      orb_collapse_redo(h, h->log_count - h->undone);
      h->undone--;
    }
    orb_refiner_abandon(ctx, r);
  }
}

void orb_refiner_abandon(orb_context *ctx, orb_refiner *r) {
  if (!r) {
    return;
  }
  for (int32_t i = 0; r->star && i < r->star_count; i++) {
    orb_star_free(ctx, &r->star[i]);
  }
  for (int32_t i = 0; r->room && i < r->star_count; i++) {
    orb_kernel_room_free(ctx, &r->room[i]);
  }
  orb_level_free(ctx, &r->level);
  orb_free(ctx, r->point);
  orb_free(ctx, r->alive);
  orb_free(ctx, r->pinned);
  orb_free(ctx, r->queued);
  orb_free(ctx, r->queue);
  orb_free(ctx, r->crowding);
  orb_free(ctx, r->star);
  orb_free(ctx, r->room);
  orb_free(ctx, r);
}

/* Coarse levels do not follow a w below 1: without the symmetric term some of their triangles grow without bound, and
 * finer levels cannot repair that. */
void orb_refiner_keep_angles(orb_refiner *r) {
  r->settings.energy = orb_newton_energy_of_angles();
}

orb_newton_energy orb_refiner_energy(const orb_refiner *r) {
  orb_newton_energy energy = r->settings.energy;
  if (r->live < r->hierarchy->surface.vertex_count && energy.angle == 0) {
    energy.w = fmax(energy.w, 1);
  }
  return energy;
}

void orb_refiner_one_way(orb_refiner *r) {
  r->one_way = 1;
}

int32_t orb_refiner_live(const orb_refiner *r) {
  return r->live;
}

orb_status orb_refiner_level(orb_context *ctx, const orb_refiner *r, int32_t **vertices, int32_t *vertex_count,
                             int32_t **triangles, int32_t *triangle_count) {
  const orb_corner_table *s = &r->hierarchy->surface;
  int32_t *v = ORB_NEW(ctx, int32_t, r->live), *t = ORB_NEW(ctx, int32_t, 3 * (2 * (int64_t)r->live - 4));
  if (!v || !t) {
    orb_free(ctx, v);
    orb_free(ctx, t);
    return ORB_E_NO_MEMORY;
  }
  int32_t count = 0, faces = 0;
  for (int32_t i = 0; i < s->vertex_count; i++) {
    if (!r->alive[i]) {
      continue;
    }
    v[count++] = s->to_mesh[i];
    int32_t start = s->vertex_corner[i], c = start;
    do {
      if ((c & 3) == 0) {
        for (int k = 0; k < 3; k++) {
          t[3 * (int64_t)faces + k] = s->to_mesh[s->corner[c + k]];
        }
        faces++;
      }
      c = orb_corner_swing(s, c);
    } while (c != start);
  }
  ORB_ASSERT(count == r->live && faces == 2 * r->live - 4);
  *vertices = v;
  *vertex_count = count;
  *triangles = t;
  *triangle_count = faces;
  return ORB_OK;
}

void orb_refiner_point(const orb_refiner *r, int32_t vertex, double out[3]) {
  memcpy(out, r->point + 4 * (int64_t)r->hierarchy->surface.from_mesh[vertex], 3 * sizeof *out);
}

void orb_refiner_move(orb_refiner *r, int32_t vertex, const double point[3]) {
  memcpy(r->point + 4 * (int64_t)r->hierarchy->surface.from_mesh[vertex], point, 3 * sizeof *point);
}

void orb_refiner_pin(orb_refiner *r, int32_t vertex, int pinned) {
  r->pinned[r->hierarchy->surface.from_mesh[vertex]] = pinned != 0;
  r->level.valid = 0;
}

void orb_refiner_points(const orb_refiner *r, double *points) {
  const orb_corner_table *s = &r->hierarchy->surface;
  for (int64_t i = 0; i < s->vertex_count; i++) {
    memcpy(points + 3 * (int64_t)s->to_mesh[i], r->point + 4 * i, 3 * sizeof *points);
  }
}
