/* The pairs, and a first map in which they meet.
 *
 * In the alignment as given the shapes meet only at the landmarks, so limbs may lie elsewhere or be twisted; and
 * vertices put straight at their spatial targets fold where limbs are thin. Instead both shapes are embedded anew with
 * the landmarks, the mirror landmarks and some samples of the spatial targets pinned together (orb_pin_walk). The
 * result is certified, near the spatial targets, and cheap. Samples only guide the walk: they are free to move
 * afterwards.
 */
#include <math.h>
#include <string.h>

#include "align/map/engine/run.h"
#include "align/map/engine/spread.h"
#include "align/map/starts/landmark_walk.h"
#include "align/map/starts/mirror.h"
#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static int is_paired(const orb_map_pairs *p, int32_t moving, int32_t fixed) {
  for (int32_t i = 0; i < p->count; i++) {
    if (p->moving[i] == moving || p->fixed[i] == fixed) {
      return 1;
    }
  }
  return 0;
}

static void add_pair(orb_map_pairs *p, int32_t moving, int32_t fixed) {
  if (moving >= 0 && fixed >= 0 && !is_paired(p, moving, fixed)) {
    ORB_ASSERT(p->count < p->capacity);
    p->moving[p->count] = moving;
    p->fixed[p->count++] = fixed;
  }
}

orb_status orb_map_pairs_create(orb_map_run *c, int mirrors) {
  orb_context *ctx = c->ctx;
  orb_status status = ORB_OK;
  orb_map_pairs *p = &c->pairs;
  size_t n = (size_t)c->landmark_count;
  int32_t found = 0, *images[2] = {ORB_NEW(ctx, int32_t, n + 1), ORB_NEW(ctx, int32_t, n + 1)};
  p->capacity = 2 * c->landmark_count + c->params.walk.usable_samples;
  p->moving = ORB_NEW(ctx, int32_t, p->capacity);
  p->fixed = ORB_NEW(ctx, int32_t, p->capacity);
  if (!images[0] || !images[1] || !p->moving || !p->fixed) {
    status = ORB_E_NO_MEMORY;
    goto done;
  }
  for (size_t i = 0; i < n; i++) {
    add_pair(p, c->moving->landmark_vertices[i], c->fixed->landmark_vertices[i]);
  }
  p->landmarks = p->count;
  if (p->count > 0 && mirrors) {
    const orb_mesh *meshes[2] = {&c->fixed->mesh, &c->moving->mesh};
    const int32_t *landmarks[2] = {p->fixed, p->moving};
    ORB_GO(status, orb_map_mirror_landmarks(ctx, &c->params, meshes, landmarks, p->count, images, &found), done);
  }
  for (int32_t i = 0; i < found; i++) {
    add_pair(p, images[1][i], images[0][i]);
  }
done:
  orb_free(ctx, images[0]);
  orb_free(ctx, images[1]);
  return status;
}

static int is_apart(const orb_map_run *c, int32_t moving, int32_t fixed) {
  double apart = c->has_usable ? c->params.walk.usable_apart : c->params.walk.apart;
  for (int32_t i = 0; i < c->pairs.count; i++) {
    double d = orb_distance2(c->x + 3 * (size_t)moving, c->x + 3 * (size_t)c->pairs.moving[i]);
    double e = orb_distance2(c->b.x + 3 * (size_t)fixed, c->b.x + 3 * (size_t)c->pairs.fixed[i]);
    if (fmin(d, e) < apart * apart) {
      return 0;
    }
  }
  return 1;
}

/* Adds samples of the spatial targets after the pairs, where the targets lie well on the fixed shape. *count: the
 * number of pairs and samples. */
static orb_status sample_targets(orb_map_run *c, int32_t samples, int32_t *count) {
  const orb_map_surface *b = &c->b;
  int32_t held = c->pairs.count, *spread = ORB_NEW(c->ctx, int32_t, samples);
  double *off = ORB_NEW(c->ctx, double, samples), mean = 0;
  orb_status status = spread && off ? orb_map_spread(c->ctx, c->x, c->vertex_count, samples, spread) : ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < samples && status == ORB_OK; i++) {
    double y[3];
    orb_map_surface_at(b, &c->target_place[spread[i]], y, NULL, NULL);
    off[i] = sqrt(orb_distance2(y, c->target + 3 * (size_t)spread[i]));
    mean += off[i] / samples;
  }
  for (int32_t i = 0; i < samples && status == ORB_OK; i++) {
    const orb_place *place = &c->target_place[spread[i]];
    double n[3];
    int32_t u = orb_map_nearest_corner(b->triangles, place);
    orb_map_surface_at(b, place, NULL, NULL, n);
    int fits = c->has_usable ? c->usable[spread[i]]
                             : off[i] <= c->params.walk.off_surface * mean &&
                                   orb_dot(n, c->target_normal + 3 * (size_t)spread[i]) >= c->params.walk.facing;
    if (fits && is_apart(c, spread[i], u)) {
      add_pair(&c->pairs, spread[i], u);
    }
  }
  *count = c->pairs.count;
  c->pairs.count = held;
  orb_free(c->ctx, spread);
  orb_free(c->ctx, off);
  return status;
}

/* The vertex of the moving shape whose spatial target is nearest to vertex u of the fixed shape and faces like it; −1:
 * none. */
static int32_t nearest_target(const orb_map_run *c, int32_t u) {
  const double *x = c->b.x + 3 * (size_t)u, *n = c->b.normal + 3 * (size_t)u;
  double least = INFINITY;
  int32_t best = -1;
  for (int32_t v = 0; v < c->vertex_count; v++) {
    double d = orb_distance2(c->target + 3 * (size_t)v, x);
    if (d < least && orb_dot(c->target_normal + 3 * (size_t)v, n) >= c->params.walk.facing) {
      least = d;
      best = v;
    }
  }
  return best;
}

/* The same with samples that are spread over the fixed shape, whose thin parts may have no sample of the moving shape.
 */
static orb_status sample_fixed(orb_map_run *c, int32_t samples, int32_t *count) {
  int32_t held = c->pairs.count, *spread = ORB_NEW(c->ctx, int32_t, samples);
  orb_status status = spread ? orb_map_spread(c->ctx, c->b.x, c->b.vertex_count, samples, spread) : ORB_E_NO_MEMORY;
  for (int32_t i = 0; i < samples && status == ORB_OK; i++) {
    int32_t v = nearest_target(c, spread[i]);
    if (v >= 0 && is_apart(c, v, spread[i])) {
      add_pair(&c->pairs, v, spread[i]);
    }
    status = orb_context_check(c->ctx);
  }
  *count = c->pairs.count;
  c->pairs.count = held;
  orb_free(c->ctx, spread);
  return status;
}

/* A shape as orb_pin_walk() takes it. It owns its points and borrows the rest. */
static orb_status borrow(orb_context *ctx, const orb_aligned_shape *shape, int32_t *landmarks, int32_t count,
                         orb_sheet *out) {
  size_t n = 3 * (size_t)shape->mesh.vertex_count;
  *out = (orb_sheet){.shape = {.mesh = shape->mesh, .landmark_vertices = landmarks},
                     .landmark_count = count,
                     .vertex_capacity = shape->mesh.vertex_count,
                     .triangle_capacity = shape->mesh.triangle_count,
                     .given_vertices = shape->mesh.vertex_count};
  out->shape.points = ORB_NEW(ctx, double, n);
  if (!out->shape.points) {
    return ORB_E_NO_MEMORY;
  }
  memcpy(out->shape.points, shape->points, n * sizeof *out->shape.points);
  return ORB_OK;
}

/* The walked spheres become those of the run. */
static orb_status take_both(orb_map_run *c, orb_sheet *fixed, const orb_sheet *moving) {
  memcpy(c->start, moving->shape.points, 3 * (size_t)c->vertex_count * sizeof *c->start);
  return orb_map_take_sphere(c, &fixed->shape.points);
}

/* Carries the walked map to the fixed shape's own sphere. */
static orb_status carry_over(orb_map_run *c, const orb_sheet *fixed, const orb_sheet *moving) {
  orb_locator *locator;
  const orb_map_surface *b = &c->b;
  ORB_TRY(orb_locator_create(c->ctx, fixed->shape.points, b->vertex_count, b->triangles, b->triangle_count, b->twin,
                             &locator));
  for (int32_t v = 0; v < c->vertex_count; v++) {
    orb_place place;
    orb_locate(locator, moving->shape.points + 3 * (size_t)v, -1, &place);
    orb_map_surface_at(b, &place, NULL, c->start + 3 * (size_t)v, NULL);
  }
  for (int32_t i = 0; i < c->pairs.count; i++) {
    memcpy(c->start + 3 * (size_t)c->pairs.moving[i], b->s + 3 * (size_t)c->pairs.fixed[i], sizeof(double[3]));
  }
  orb_locator_destroy(c->ctx, locator);
  return ORB_OK;
}

/* Embeds both shapes anew so that the first `count` pairs meet, into sheets. finer: factor on the coarse level; last:
 * see orb_pin_walk(). */
static orb_status walk_sheets(orb_map_run *c, int32_t count, int32_t finer, orb_sheet sheets[2], orb_walk_level *last,
                              int *stuck) {
  orb_context *ctx = c->ctx;
  orb_status status = ORB_OK;
  int32_t coarse = c->params.walk.level_each * count;
  coarse = finer * (coarse > c->params.walk.level ? coarse : c->params.walk.level);
  const orb_walk_options options = {ORB_PRESET_FAST, coarse, c->keeps_angles};
  int32_t *numbers = ORB_NEW(ctx, int32_t, count);
  if (!numbers) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < count; i++) {
    numbers[i] = i;
  }
  ORB_GO(status, borrow(ctx, c->fixed, c->pairs.fixed, count, &sheets[0]), done);
  ORB_GO(status, borrow(ctx, c->moving, c->pairs.moving, count, &sheets[1]), done);
  status = orb_pin_walk(ctx, sheets, 2, numbers, count, &options, last, stuck);
done:
  orb_free(ctx, numbers);
  return status;
}

static void free_sheets(orb_map_run *c, orb_sheet sheets[2]) {
  for (int s = 0; s < 2; s++) {
    orb_free(c->ctx, sheets[s].shape.points);
    sheets[s].shape.points = NULL;
  }
}

static orb_status walk_pairs(orb_map_run *c, int32_t count, int *stuck) {
  orb_sheet sheets[2] = {0};
  orb_status status;
  ORB_GO(status, walk_sheets(c, count, 1, sheets, NULL, stuck), done);
  if (!*stuck) {
    status = c->both ? take_both(c, &sheets[0], &sheets[1]) : carry_over(c, &sheets[0], &sheets[1]);
  }
done:
  free_sheets(c, sheets);
  return status;
}

orb_status orb_map_walk_level(orb_map_run *c, int32_t samples, orb_walk_level *level, double **fixed, int *stuck) {
  orb_sheet sheets[2] = {0};
  int32_t count = c->pairs.count;
  *stuck = 1;
  if (samples != 0) {
    ORB_TRY(samples > 0 ? sample_targets(c, samples, &count) : sample_fixed(c, -samples, &count));
  }
  if (count == 0) {
    return ORB_OK;
  }
  orb_status status = walk_sheets(c, count, 1, sheets, level, stuck);
  if (status == ORB_OK && *stuck && samples == 0) {
    free_sheets(c, sheets);
    status = walk_sheets(c, c->pairs.landmarks, 2, sheets, level, stuck);
  }
  if (status == ORB_OK && !*stuck) {
    *fixed = sheets[0].shape.points;
    sheets[0].shape.points = NULL;
  }
  free_sheets(c, sheets);
  return status;
}

orb_status orb_map_landmark_walk(orb_map_run *c, int32_t samples, int *stuck) {
  int32_t count = c->pairs.count;
  *stuck = 1;
  if (samples > 0 && c->vertex_count > c->params.walk.least_each * samples) {
    ORB_TRY(sample_targets(c, samples, &count));
  }
  if (samples > 0 && count == c->pairs.count) {
    return ORB_OK; /* no sample fits: the caller walks without samples */
  }
  return walk_pairs(c, count, stuck);
}
