/* Sweeps of the composed map: the vector loops against the step of a single vertex, and paths over the fixed shape. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/map/engine/star.h"
#include "align/map/engine/step.h"
#include "align/map/engine/sweep.h"
#include "align/map/engine/vector/loops.h"
#include "align/map/engine/vector/trace.inc.h"
#include "numeric/vec3.h"
#include "support_shapes.h"

enum { AROUND = 80 }; /* vertices of a ring of the globe, and neighbours of its poles */

/* A level over a fixed shape. */
typedef struct scene {
  orb_context *ctx;
  orb_mesh fixed, moving;
  double *fixed_points;
  orb_map_params params;
  orb_map_surface surface;
  orb_map_packed packed;
  orb_corner_table table;
  int32_t *local;
  unsigned char *alive, *pinned;
  orb_map_level level;
} scene;

static uint32_t seed;

static double chance(void) {
  seed = seed * 1664525U + 1013904223U;
  return seed / 4294967296.0;
}

/* Moves vertices in and out, in bumps that have no symmetry. */
static void bump(orb_mesh *mesh, double size, double phase) {
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    double *p = mesh->positions + 3 * (size_t)v;
    double f = 1 + size * pow(fabs(sin(4 * p[0] + phase) * cos(3 * p[1] + p[2])), 6);
    for (int k = 0; k < 3; k++) {
      p[k] *= f;
    }
  }
}

static void fill_level(scene *s, const double *directions, double noise) {
  orb_map_level *l = &s->level;
  for (int32_t v = 0; v < l->count; v++) {
    const double *from = directions + 3 * (size_t)s->table.to_mesh[v];
    double *x = l->x + 3 * (size_t)v;
    for (int k = 0; k < 3; k++) {
      x[k] = from[k] + noise * (chance() - 0.5);
      l->target[3 * (size_t)v + (size_t)k] = from[k];
    }
    orb_normalize(x);
  }
  for (int32_t i = 0; i < 3 * l->triangle_count; i++) { /* vector loops read floats */
    orb_map_spoke *p = &l->spoke[i];
    p->cv = (float)p->cv;
    p->cq = (float)p->cq;
    p->cr = (float)p->cr;
    p->area = (float)p->area;
  }
  assert_int_equal(orb_map_level_locate_all(s->ctx, l, &s->surface, 1), ORB_OK);
}

/* moving: on the unit sphere; the scene frees it. noise: of its points; more than an edge folds some triangles. */
static void make(scene *s, orb_cpu cpu, int threads, orb_mesh (*moving)(orb_context *), double noise) {
  *s = (scene){.params = orb_map_params_of(ORB_PRESET_DEFAULT)};
  const orb_context_options options = {.threads = threads, .cpu = cpu};
  seed = 12345;
  assert_int_equal(orb_context_create(&options, &s->ctx), ORB_OK);
  s->fixed = shape_ball(s->ctx, 4);
  s->moving = moving(s->ctx);
  size_t n = (size_t)s->moving.vertex_count, m = (size_t)s->fixed.vertex_count;
  double *directions = malloc(3 * n * sizeof *directions);
  s->fixed_points = malloc(3 * m * sizeof *s->fixed_points);
  s->local = malloc(n * sizeof *s->local);
  s->alive = malloc(n);
  s->pinned = calloc(n, 1);
  assert_true(directions && s->fixed_points && s->local && s->alive && s->pinned);
  memcpy(directions, s->moving.positions, 3 * n * sizeof *directions);
  memcpy(s->fixed_points, s->fixed.positions, 3 * m * sizeof *s->fixed_points);
  memset(s->alive, 1, n);
  for (size_t v = 0; v < n; v += 50) {
    s->pinned[v] = 1;
  }
  bump(&s->fixed, 2, 1);
  bump(&s->moving, 1, 1.3);
  orb_aligned_shape shape = {.mesh = s->fixed, .points = s->fixed_points};
  assert_int_equal(orb_map_surface_create(s->ctx, &shape, &s->surface), ORB_OK);
  assert_int_equal(orb_map_packed_create(s->ctx, &s->fixed, &s->surface, &s->packed), ORB_OK);
  assert_int_equal(orb_corner_table_create(s->ctx, &s->moving, &s->table), ORB_OK);
  assert_int_equal(orb_map_level_create(s->ctx, &s->params, &s->table, s->alive, s->pinned, s->table.position,
                                        s->moving.vertex_count, s->local, &s->level),
                   ORB_OK);
  fill_level(s, directions, noise);
  orb_map_packed_enter(&s->packed, &s->level);
  free(directions);
}

static void drop(scene *s) {
  orb_map_level_free(s->ctx, &s->level);
  orb_corner_table_free(s->ctx, &s->table);
  orb_map_packed_free(s->ctx, &s->packed);
  orb_map_surface_free(s->ctx, &s->surface);
  shape_free(s->ctx, &s->fixed);
  shape_free(s->ctx, &s->moving);
  free(s->fixed_points);
  free(s->local);
  free(s->alive);
  free(s->pinned);
  orb_context_destroy(s->ctx);
}

static orb_mesh globe(orb_context *ctx) {
  return shape_globe(ctx, AROUND, 30);
}

static orb_mesh small_ball(orb_context *ctx) {
  return shape_ball(ctx, 4);
}

static orb_mesh large_ball(orb_context *ctx) {
  return shape_ball(ctx, 6);
}

static orb_map_rules rules_of(const scene *s, int soft, double barrier) {
  return (orb_map_rules){.soft = soft,
                         .barrier = barrier,
                         .epsilon = s->params.star.epsilon,
                         .omega = soft ? 1 : s->params.sweep.over,
                         .still = 0};
}

static int64_t sweep(scene *s, const orb_map_rules *rules, int count) {
  int64_t work = 0;
  assert_int_equal(orb_map_level_sweeps(s->ctx, &s->level, &s->packed, rules, count, 0, &work), ORB_OK);
  return -work;
}

/* The same sweep by the step of a single vertex; returns how many moved. */
static int32_t sweep_singly(scene *s, const orb_map_rules *rules) {
  int32_t moved = 0;
  for (int32_t i = 0; i < s->level.moving; i++) {
    int32_t v = s->level.by_group[i];
    s->level.moved[v] = orb_map_level_step(&s->level, &s->packed.b, rules, v);
    moved += s->level.moved[v] > 0;
  }
  return moved;
}

static void assert_near(const double *x, const double *y, size_t count) {
  for (size_t i = 0; i < count; i++) {
    assert_true(fabs(x[i] - y[i]) <= 1e-9);
  }
}

typedef struct sweep_case {
  const char *name;
  int soft;
  double barrier, noise, pull, upright, hinge; /* 0: upright and hinge as they are */
} sweep_case;

static void compare(const sweep_case *c, orb_cpu cpu, orb_mesh (*moving)(orb_context *)) {
  scene one, many, *both[2] = {&one, &many};
  for (int i = 0; i < 2; i++) {
    scene *s = both[i];
    make(s, cpu, 1, moving, c->noise);
    s->params.star.upright = c->upright > 0 ? c->upright : s->params.star.upright;
    s->params.star.hinge = c->hinge > 0 ? c->hinge : s->params.star.hinge;
    for (int32_t v = 0; v < s->level.count; v += 2) {
      s->level.pull[v] = c->pull * s->level.area[v];
    }
  }
  const orb_map_level *a = &one.level, *b = &many.level;
  const size_t n = (size_t)a->count;
  double before = orb_map_level_energy(a);
  const orb_map_rules rules = rules_of(&one, c->soft, c->barrier);
  int32_t moved = sweep_singly(&one, &rules);
  assert_true(moved > a->count / 2);
  assert_int_equal(sweep(&many, &rules, 1), a->moving);
  print_message("%s, %s: %d of %d moved, energy %.3f to %.3f\n", c->name, orb_map_loops_of(cpu)->name, moved, a->count,
                before, orb_map_level_energy(b));
  assert_near(a->y, b->y, 3 * n);
  assert_near(a->x, b->x, 3 * n);
  assert_near(a->n, b->n, 3 * n);
  for (size_t v = 0; v < n; v++) {
    assert_true(a->pinned[v] || fabs(a->moved[v] - b->moved[v]) <= 1e-9);
  }
  assert_true(fabs(orb_map_level_energy(a) - orb_map_level_energy(b)) <= 1e-9 * before);
  drop(&one);
  drop(&many);
}

/* A sweep moves every vertex as the step of a single vertex does, with every instruction set. */
static void test_same_as_single(void **unused) {
  (void)unused;
  static const sweep_case cases[] = {
      {.name = "hard", .barrier = 1, .noise = 0.01},
      {.name = "hard and pulled", .barrier = 1, .noise = 0.01, .pull = 5},
      {.name = "soft with flips", .soft = 1, .barrier = 1e-3, .noise = 0.15},
      {.name = "soft, strong barrier, pulled", .soft = 1, .barrier = 1, .noise = 0.15, .pull = 1},
      {.name = "hard, most at the barrier", .barrier = 1, .noise = 0.01, .hinge = 1.2},
      {.name = "normals of the triangles", .barrier = 1, .noise = 0.01, .upright = 2.9}};
  orb_context *widest;
  assert_int_equal(orb_context_create(NULL, &widest), ORB_OK);
  for (orb_cpu cpu = ORB_CPU_PLAIN; cpu <= orb_context_cpu(widest); cpu++) {
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
      compare(&cases[i], cpu, small_ball);
    }
    compare(&cases[0], cpu, globe);
  }
  orb_context_destroy(widest);
}

/* Every vertex that moves is in one group, and no neighbours are in one. What sweeps of two parts move and read at once
 * are different vertices: only the border lies between parts. */
static void test_parts(void **unused) {
  (void)unused;
  orb_mesh (*const meshes[])(orb_context *) = {globe, small_ball, large_ball};
  int32_t most = 0;
  for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++) {
    scene s;
    make(&s, ORB_CPU_AUTO, 1, meshes[i], 0.01);
    const orb_map_level *l = &s.level;
    const int32_t groups = (l->parts + 1) * l->colours;
    int32_t *group = malloc((size_t)l->count * sizeof *group), inside = 0;
    assert_non_null(group);
    memset(group, -1, (size_t)l->count * sizeof *group);
    for (int32_t g = 0; g < groups; g++) {
      for (int32_t k = l->group_start[g]; k < l->group_start[g + 1]; k++) {
        assert_int_equal(group[l->by_group[k]], -1);
        group[l->by_group[k]] = g;
      }
    }
    for (int32_t v = 0; v < l->count; v++) {
      assert_true((group[v] >= 0) == !l->pinned[v]);
      const int32_t part = group[v] / l->colours;
      inside += group[v] >= 0 && part < l->parts;
      for (int32_t k = l->start[v]; k < l->start[v + 1] && group[v] >= 0; k++) {
        const int32_t other = group[l->spoke[k].q], beside = other / l->colours;
        assert_int_not_equal(group[v], other);
        assert_true(other < 0 || part == beside || part == l->parts || beside == l->parts);
      }
    }
    assert_true(inside > 3 * l->moving / 4); /* most of the work is done side by side */
    most = l->parts > most ? l->parts : most;
    print_message("%d vertices: %d parts, %d vertices between them\n", l->count, l->parts, l->moving - inside);
    free(group);
    drop(&s);
  }
  assert_true(most > 4);
}

/* The level has several parts; vertices begin to wait. */
static void test_same_for_threads(void **unused) {
  (void)unused;
  double *first = NULL;
  int64_t steps = 0;
  for (int threads = 1; threads <= 3; threads++) {
    scene s;
    make(&s, ORB_CPU_AUTO, threads, large_ball, 0.01);
    size_t size = 9 * (size_t)s.level.count * sizeof(double);
    orb_map_rules rules = rules_of(&s, 0, 1);
    rules.still = 5e-3 * sqrt(4 * M_PI / s.level.triangle_count);
    int64_t count = sweep(&s, &rules, 8);
    if (!first) {
      first = malloc(size);
      assert_non_null(first);
      memcpy(first, s.level.y, size); /* y, n and x */
      steps = count;
      assert_in_range(steps, s.level.count, 8 * s.level.count - 1000);
    }
    assert_memory_equal(first, s.level.y, size);
    assert_int_equal(count, steps);
    drop(&s);
  }
  free(first);
}

/* A vertex with more neighbours than a batch holds moves by the step of a single vertex, and its neighbours use its new
 * point. */
static void test_large_star(void **unused) {
  (void)unused;
  scene s;
  make(&s, ORB_CPU_AUTO, 2, globe, 0.002);
  const orb_map_level *l = &s.level;
  int32_t large = 0;
  double before[2][3];
  int32_t pole[2];
  for (int32_t v = 0; v < l->count; v++) {
    if (l->start[v + 1] - l->start[v] == AROUND) {
      assert_true(large < 2 && !l->pinned[v]);
      memcpy(before[large], l->y + 3 * (size_t)v, sizeof before[0]);
      pole[large++] = v;
    }
  }
  assert_int_equal(large, 2);
  assert_in_range(AROUND, ORB_MAP_STEP_RING_MAX + 1, ORB_MAP_RING_MAX);
  const orb_map_rules rules = rules_of(&s, 1, 1);
  (void)sweep(&s, &rules, 1);
  for (int i = 0; i < 2; i++) {
    double far = sqrt(orb_distance2(before[i], l->y + 3 * (size_t)pole[i]));
    assert_true(far > 1e-6);
    assert_true(isfinite(l->moved[pole[i]]) && l->moved[pole[i]] >= far * (1 - 1e-9));
  }
  drop(&s);
}

/* Paths computed by rates and rotations end where those computed by positions do, and have the same length. */
static void test_paths(void **unused) {
  (void)unused;
  scene s;
  make(&s, ORB_CPU_PLAIN, 1, small_ball, 0);
  const orb_map_surface *b = &s.packed.b;
  int crossed = 0;
  for (int i = 0; i < 20000; i++) {
    orb_place from = {.triangle = (int32_t)(chance() * b->triangle_count), .at = {chance(), chance(), chance()}}, end;
    double angle = 2 * M_PI * chance(), length = pow(10, -4 + 4 * chance()), sum = from.at[0] + from.at[1] + from.at[2];
    for (int k = 0; k < 3; k++) {
      from.at[k] /= sum;
    }
    const double step[2] = {length * cos(angle), length * sin(angle)};
    step_path p = {from.triangle, -1, {from.at[0], from.at[1], from.at[2]}, {step[0], step[1]}};
    assert_true(orb_map_surface_trace(b, &from, step, &end));
    assert_true(path_end(&s.packed, &p));
    orb_place got = {.triangle = p.triangle, .at = {p.at[0], p.at[1], p.at[2]}};
    double y[2][3];
    orb_map_surface_at(b, &end, y[0], NULL, NULL);
    orb_map_surface_at(b, &got, y[1], NULL, NULL);
    assert_near(y[0], y[1], 3);
    assert_true(fabs(p.at[0] + p.at[1] + p.at[2] - 1) < 1e-12);
    crossed += end.triangle != from.triangle;
  }
  assert_in_range(crossed, 5000, 19000);
  drop(&s);
}

/* A surface that was moved to other points on the sphere reads as one that was made there: the points turn by a quarter
 * around an axis, so what reads them must turn too. */
static void test_moved_surface(void **unused) {
  scene s;
  (void)unused;
  make(&s, ORB_CPU_AUTO, 1, globe, 0.1);
  const size_t n = 3 * (size_t)s.fixed.vertex_count, m = (size_t)s.fixed.triangle_count;
  double *turned = malloc(n * sizeof *turned), *density = malloc(m * sizeof *density);
  assert_true(turned && density);
  memcpy(density, s.packed.b.density, m * sizeof *density);
  for (size_t i = 0; i < n; i += 3) {
    const double p[3] = {-s.fixed_points[i + 1], s.fixed_points[i], s.fixed_points[i + 2]};
    memcpy(turned + i, p, sizeof p);
  }
  assert_int_equal(orb_map_surface_move(s.ctx, &s.surface, turned), ORB_OK);
  orb_map_packed_move(&s.surface, &s.packed);
  for (int32_t t = 0; t < s.fixed.triangle_count; t++) {
    const orb_place place = {.triangle = t, .at = {0.25, 0.5, 0.25}}, packed = {s.packed.to[t], {0.25, 0.5, 0.25}};
    double x[3], y[3], was[3], sum = 0;
    orb_place found;
    for (int k = 0; k < 3; k++) { /* by the file's own points, turned */
      was[k] = 0;
      for (int c = 0; c < 3; c++) {
        was[k] += place.at[c] * turned[3 * (size_t)s.fixed.triangles[3 * t + c] + (size_t)k];
      }
      sum += was[k] * was[k];
    }
    orb_map_surface_at(&s.surface, &place, NULL, x, NULL);
    orb_map_surface_at(&s.packed.b, &packed, NULL, y, NULL);
    for (int k = 0; k < 3; k++) {
      assert_true(fabs(x[k] - was[k] / sqrt(sum)) < 1e-14);
      assert_true(x[k] == y[k]);
    }
    orb_locate(s.surface.locator, x, -1, &found);
    assert_int_equal(found.triangle, t);
    assert_true(fabs(s.packed.b.density[s.packed.to[t]] - density[s.packed.to[t]]) < 1e-12 * density[s.packed.to[t]]);
    assert_true(s.packed.triangle_row[ORB_MAP_ROW * (size_t)s.packed.to[t] + 10] == s.surface.density[t]);
  }
  for (int32_t v = 0; v < s.fixed.vertex_count; v++) {
    const double *row = s.packed.vertex_row + ORB_MAP_ROW * (size_t)v;
    assert_memory_equal(row + 3, turned + 3 * (size_t)s.packed.vertex[v], sizeof(double[3]));
  }
  free(turned);
  free(density);
  drop(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_same_as_single), cmocka_unit_test(test_parts), cmocka_unit_test(test_same_for_threads),
      cmocka_unit_test(test_large_star),     cmocka_unit_test(test_paths), cmocka_unit_test(test_moved_surface)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
