/* The newton embedding: always valid, equal for any number of threads, cancellable, within its memory limit. */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "orbmorph/embed.h"
#include "support_align.h"
#include "support_exact.h"
#include "support_failing.h"
#include "support_shapes.h"

static orb_context *open_context(int threads) {
  orb_context *ctx;
  orb_context_options options = {.threads = threads};
  assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
  return ctx;
}

static orb_embedding embed_with(orb_context *ctx, const orb_mesh *mesh, orb_preset preset, double weight) {
  orb_embed_options options;
  orb_embed_defaults(&options);
  options.preset = preset;
  options.energy_weight = weight;
  orb_embedding out;
  orb_status status = orb_embed(ctx, mesh, &options, &out);
  if (status != ORB_OK) {
    print_message("%s\n", orb_context_error(ctx)->detail);
  }
  assert_int_equal(status, ORB_OK);
  return out;
}

/* Embeds with every preset and weight and verifies the result independently. */
static void check_mesh(orb_context *ctx, const orb_mesh *mesh) {
  static const double weights[] = {1, 0, 0.3};
  const int large = mesh->triangle_count > 5000;
  for (int i = 0; i < (IS_SLOW && large ? 4 : 5); i++) { /* with sanitizers the weights 0 and 0.3 run the same code */
    if (i == ORB_PRESET_QUALITY && large) {
      continue; /* long */
    }
    orb_embedding e = embed_with(ctx, mesh, i < 3 ? (orb_preset)i : ORB_PRESET_DEFAULT, weights[i < 3 ? 0 : i - 2]);
    assert_true(e.certificate.valid && e.certificate.exact);
    for (int32_t v = 0; v < mesh->vertex_count; v++) {
      const double *p = e.points + 3 * v;
      assert_true(fabs(sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - 1) < 1e-12);
    }
    int32_t step = mesh->triangle_count / 300 + 1; /* a sample: schoolbook exact arithmetic is slow */
    for (int32_t t = 0; t < mesh->triangle_count; t += step) {
      const int32_t *v = mesh->triangles + 3 * t;
      assert_int_equal(exact_orientation(e.points + 3 * v[0], e.points + 3 * v[1], e.points + 3 * v[2]), 1);
    }
    assert_true(e.timings.total >= e.timings.embed);
    orb_embedding_free(ctx, &e);
  }
}

static void test_platonic(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(2);
  orb_mesh list[] = {shape_tetrahedron(ctx), shape_octahedron(ctx), shape_icosahedron(ctx)};
  for (int i = 0; i < 3; i++) {
    check_mesh(ctx, &list[i]);
    orb_embedding e = embed_with(ctx, &list[i], ORB_PRESET_DEFAULT, 1); /* all faces alike: a rotation is best */
    assert_true(e.distortion.symmetric_dirichlet.mean < 1 + 1e-3);
    assert_true(e.distortion.angle.max < 1.05);
    orb_embedding_free(ctx, &e);
    shape_free(ctx, &list[i]);
  }
  orb_context_destroy(ctx);
}

/* A ball already lies on a sphere, so the distortion must be small. */
static void test_ball(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(2);
  orb_mesh mesh = shape_ball(ctx, 5);
  check_mesh(ctx, &mesh);
  orb_embedding e = embed_with(ctx, &mesh, ORB_PRESET_DEFAULT, 1);
  assert_true(e.distortion.symmetric_dirichlet.mean < 1.01);
  assert_true(e.distortion.stretch_efficiency > 0.98);
  orb_embedding_free(ctx, &e);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

static void test_long_and_poles(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(2);
  orb_mesh list[] = {shape_cylinder(ctx, 12, 600, 1000), shape_cylinder(ctx, 6, 60, 1e6),     shape_globe(ctx, 2000, 4),
                     shape_globe(ctx, 2000, 2),          shape_cylinder(ctx, 2000, 3, 0.001), shape_globe(ctx, 3, 400)};
  for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
    check_mesh(ctx, &list[i]);
    shape_free(ctx, &list[i]);
  }
  orb_context_destroy(ctx);
}

/* Meaningless positions: the connectivity alone must suffice. */
static void test_degenerate_positions(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(2);
  for (int kind = 0; kind < 9; kind++) {
    orb_mesh mesh = shape_ball(ctx, kind == 8 ? 1 : 4);
    uint32_t seed = 12345;
    for (int32_t i = 0; i < 3 * mesh.vertex_count; i++) {
      seed = seed * 1664525U + 1013904223U;
      double random = seed / 4294967296.0, *x = &mesh.positions[i];
      switch (kind) {
        case 0:
          *x = 7;
          break; /* all equal */
        case 1:
          *x = i % 3 == 2 ? 0 : *x;
          break; /* flattened */
        case 2:
          *x = i % 3 == 0 ? *x : 0;
          break; /* a needle */
        case 3:
          *x = random;
          break; /* crumpled at random */
        case 4:
          *x = i % 6 < 3 ? *x : mesh.positions[i - 3];
          break; /* every second position is a duplicate */
        case 5:
          *x *= 1e-310;
          break; /* subnormal */
        case 6:
          *x *= 1.7e308;
          break; /* the sum of two overflows */
        case 7:
          *x = i % 3 ? *x * 1e-150 : *x * 1e150;
          break; /* squares overflow */
        default:
          *x = i < 9 ? 1e300 * random : random * 1e-300;
          break; /* one huge triangle */
      }
    }
    check_mesh(ctx, &mesh);
    shape_free(ctx, &mesh);
  }
  orb_context_destroy(ctx);
}

static void test_same_bytes(void **unused) {
  (void)unused;
  static const int threads[] = {1, 2, 3, 8, 2};
  double *first = NULL;
  for (int i = 0; i < 5; i++) {
    orb_context *ctx = open_context(threads[i]);
    orb_mesh mesh = shape_ball(ctx, 6);
    for (int32_t v = 0; v < mesh.vertex_count; v++) { /* limbs, so that all paths run */
      double *p = mesh.positions + 3 * v, f = 1 + 3 * pow(fabs(sin(5 * p[0]) * cos(4 * p[1])), 8);
      for (int k = 0; k < 3; k++) {
        p[k] *= f;
      }
    }
    orb_embedding e = embed_with(ctx, &mesh, ORB_PRESET_DEFAULT, 1);
    size_t size = 24 * (size_t)mesh.vertex_count;
    if (!first) {
      first = malloc(size);
      assert_non_null(first);
      memcpy(first, e.points, size);
    }
    assert_memory_equal(first, e.points, size);
    orb_embedding_free(ctx, &e);
    shape_free(ctx, &mesh);
    orb_context_destroy(ctx);
  }
  free(first);
}

static void *cancel_later(void *argument) {
  double until = orb_clock() + 0.03;
  while (orb_clock() < until) {
  }
  orb_context_cancel(argument);
  return NULL;
}

static void test_cancel(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(2);
  orb_mesh mesh = shape_ball(ctx, 8);
  pthread_t thread;
  assert_int_equal(pthread_create(&thread, NULL, cancel_later, ctx), 0);
  orb_embedding e;
  assert_int_equal(orb_embed(ctx, &mesh, NULL, &e), ORB_E_CANCELLED);
  assert_null(e.points);
  pthread_join(thread, NULL);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx); /* asserts that nothing leaked */
}

typedef struct cancelling {
  orb_context *ctx;
  int left; /* calls of progress before it cancels */
  double cpu;
} cancelling;

static double cpu_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void cancel_now(void *user, const char *stage, double fraction) {
  (void)stage;
  (void)fraction;
  cancelling *c = user;
  if (c->left-- == 0) {
    orb_context_cancel(c->ctx);
    c->cpu = cpu_seconds();
  }
}

/* Two poles of valence 20,000, with sanitizers 5,000, cancelled at every seventh reported step, in all stages. The
 * bound on the remaining work is processor time, so a busy machine does not matter. The documented limit is 100 ms; the
 * bound here is one second, for the sanitizers. */
static void test_cancel_everywhere(void **unused) {
  (void)unused;
  orb_context *plain = open_context(1);
  orb_mesh mesh = shape_globe(plain, IS_SLOW ? 5000 : 20000, 2);
  int cancelled = 0, done = 0;
  for (int n = 0; !done; n += IS_SLOW ? 23 : 7) {
    cancelling c = {.left = n};
    orb_context_options options = {.threads = 1, .progress = cancel_now, .progress_user = &c};
    assert_int_equal(orb_context_create(&options, &c.ctx), ORB_OK);
    orb_embedding e;
    orb_status status = orb_embed(c.ctx, &mesh, NULL, &e);
    if (status == ORB_OK) {
      done = c.left >= 0 || cancelled > 0;
      orb_embedding_free(c.ctx, &e);
    } else {
      assert_int_equal(status, ORB_E_CANCELLED);
      assert_true(cpu_seconds() - c.cpu < 1);
      cancelled++;
    }
    orb_context_destroy(c.ctx);
  }
  assert_true(cancelled >= 5);
  shape_free(plain, &mesh);
  orb_context_destroy(plain);
}

/* Makes the first, second, third … allocation fail: each time an error, no leak, no crash. */
static void test_every_allocation(void **unused) {
  (void)unused;
  orb_context *plain = open_context(1);
  orb_mesh mesh = shape_globe(plain, 70, 6);
  assert_true(failing_embeds(&mesh, NULL) > 30);
  shape_free(plain, &mesh);
  orb_context_destroy(plain);
}

static void test_budget(void **unused) {
  (void)unused;
  orb_context *plain = open_context(1);
  orb_mesh mesh = shape_ball(plain, 6);
  orb_context_options options = {.threads = 2, .memory_limit = 250 * (size_t)mesh.triangle_count};
  for (int i = 0; i < 20; i++) {
    orb_context *ctx;
    assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
    orb_embedding e;
    orb_status status = orb_embed(ctx, &mesh, NULL, &e);
    if (i == 0) {
      assert_int_equal(status, ORB_OK); /* 250 bytes per triangle are enough */
      orb_embedding_free(ctx, &e);
    } else {
      assert_int_equal(status, ORB_E_NO_MEMORY);
    }
    orb_context_destroy(ctx);
    options.memory_limit = (size_t)mesh.triangle_count * (size_t)(5 + 6 * i);
  }
  shape_free(plain, &mesh);
  orb_context_destroy(plain);
}

static void test_bad_requests(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(1);
  orb_mesh mesh = shape_octahedron(ctx);
  orb_embed_options options;
  orb_embedding e;
  orb_embed_defaults(&options);
  options.energy_weight = -1;
  assert_int_equal(orb_embed(ctx, &mesh, &options, &e), ORB_E_BAD_OPTION);
  options.energy_weight = NAN;
  assert_int_equal(orb_embed(ctx, &mesh, &options, &e), ORB_E_BAD_OPTION);
  int32_t saved = mesh.triangles[0];
  mesh.triangles[0] = mesh.triangles[3]; /* no longer closed */
  assert_int_not_equal(orb_embed(ctx, &mesh, NULL, &e), ORB_OK);
  mesh.triangles[0] = saved;
  mesh.positions[4] = NAN;
  assert_int_equal(orb_embed(ctx, &mesh, NULL, &e), ORB_E_NOT_FINITE);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_platonic),
                                     cmocka_unit_test(test_ball),
                                     cmocka_unit_test(test_long_and_poles),
                                     cmocka_unit_test(test_degenerate_positions),
                                     cmocka_unit_test(test_same_bytes),
                                     cmocka_unit_test(test_cancel),
                                     cmocka_unit_test(test_cancel_everywhere),
                                     cmocka_unit_test(test_every_allocation),
                                     cmocka_unit_test(test_budget),
                                     cmocka_unit_test(test_bad_requests)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
