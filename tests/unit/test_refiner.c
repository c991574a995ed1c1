/* The hierarchy and its refiner as the alignment uses them, and the vector loops of every instruction set. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "embed/common/kernel.h"
#include "embed/newton/advance.h"
#include "embed/newton/refiner.h"
#include "embed/newton/vector/loops.h"
#include "support_context.h"
#include "support_exact.h"
#include "support_shapes.h"

static void assert_near(double x, double y, double within) {
  assert_true(fabs(x - y) <= within);
}

/* An asymmetric ball with bumps. */
static orb_mesh bumpy(int levels) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * v, f = 1 + 2 * pow(fabs(sin(4 * p[0] + 1) * cos(3 * p[1] + p[2])), 6);
    for (int k = 0; k < 3; k++) {
      p[k] *= f;
    }
  }
  return mesh;
}

/* Every triangle of the current level is exactly positive, and there are 2n − 4 of them. */
static void check_level(const orb_refiner *refiner) {
  int32_t *vertices, *triangles, vertex_count, triangle_count;
  assert_int_equal(orb_refiner_level(ctx, refiner, &vertices, &vertex_count, &triangles, &triangle_count), ORB_OK);
  assert_int_equal(vertex_count, orb_refiner_live(refiner));
  assert_int_equal(triangle_count, 2 * vertex_count - 4);
  for (int32_t t = 0; t < triangle_count; t++) {
    double p[3][3];
    for (int k = 0; k < 3; k++) {
      orb_refiner_point(refiner, triangles[3 * t + k], p[k]);
    }
    assert_int_equal(exact_orientation(p[0], p[1], p[2]), 1);
  }
  orb_free(ctx, vertices);
  orb_free(ctx, triangles);
}

static orb_refiner *start(orb_hierarchy *hierarchy) {
  orb_embed_options options;
  orb_embed_defaults(&options);
  orb_refiner *refiner;
  assert_int_equal(orb_refiner_create(ctx, hierarchy, &options, &refiner), ORB_OK);
  return refiner;
}

static void test_levels(void **unused) {
  (void)unused;
  orb_mesh mesh = bumpy(4);
  orb_hierarchy *hierarchy;
  assert_int_equal(orb_hierarchy_create(ctx, &mesh, NULL, 0, &hierarchy), ORB_OK);
  orb_refiner *refiner = start(hierarchy);
  assert_int_equal(orb_refiner_live(refiner), 4);
  check_level(refiner);
  for (int32_t want = 5; orb_refiner_live(refiner) < mesh.vertex_count; want *= 2) {
    assert_int_equal(orb_refiner_advance(ctx, refiner, want), ORB_OK);
    assert_true(orb_refiner_live(refiner) >= (want < mesh.vertex_count ? want : mesh.vertex_count));
    check_level(refiner);
  }
  orb_refiner_destroy(ctx, refiner);
  orb_hierarchy_destroy(ctx, hierarchy);
  shape_free(ctx, &mesh);
}

/* A hierarchy can serve several refiners in sequence: going back is exact, so the second gives the same points. */
static void test_again(void **unused) {
  (void)unused;
  orb_mesh mesh = bumpy(5);
  size_t size = 24 * (size_t)mesh.vertex_count;
  double *points[3];
  orb_hierarchy *hierarchy;
  assert_int_equal(orb_hierarchy_create(ctx, &mesh, NULL, 0, &hierarchy), ORB_OK);
  for (int i = 0; i < 3; i++) {
    points[i] = malloc(size);
    assert_non_null(points[i]);
    orb_refiner *refiner = start(hierarchy);
    assert_int_equal(orb_refiner_advance(ctx, refiner, i == 1 ? 500 : mesh.vertex_count), ORB_OK);
    if (i != 1) {
      orb_refiner_points(refiner, points[i]);
    }
    orb_refiner_destroy(ctx, refiner);
  }
  assert_memory_equal(points[0], points[2], size);
  for (int i = 0; i < 3; i++) {
    free(points[i]);
  }
  orb_hierarchy_destroy(ctx, hierarchy);
  shape_free(ctx, &mesh);
}

/* Kept vertices exist on their level; pinned vertices never move by a bit. */
static void test_keep_and_pin(void **unused) {
  (void)unused;
  orb_mesh mesh = bumpy(5);
  unsigned char *keep = calloc((size_t)mesh.vertex_count, 1);
  assert_non_null(keep);
  for (int32_t i = 0; i < 40; i++) {
    keep[i * 97 % mesh.vertex_count] = 1;
  }
  orb_hierarchy *hierarchy;
  assert_int_equal(orb_hierarchy_create(ctx, &mesh, keep, 200, &hierarchy), ORB_OK);
  orb_refiner *refiner = start(hierarchy);
  assert_int_equal(orb_refiner_advance(ctx, refiner, 200), ORB_OK);
  int32_t *vertices, *triangles, vertex_count, triangle_count, found = 0, total = 0;
  assert_int_equal(orb_refiner_level(ctx, refiner, &vertices, &vertex_count, &triangles, &triangle_count), ORB_OK);
  for (int32_t i = 0; i < vertex_count; i++) {
    found += keep[vertices[i]];
  }
  double held[64][3];
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    if (keep[v]) {
      orb_refiner_point(refiner, v, held[total++]);
      orb_refiner_pin(refiner, v, 1);
    }
  }
  assert_int_equal(found, total);
  double gain = -1;
  assert_int_equal(orb_refiner_sweep(ctx, refiner, 5, &gain), ORB_OK);
  assert_true(gain >= 0 && gain < 1);
  assert_int_equal(orb_refiner_advance(ctx, refiner, mesh.vertex_count), ORB_OK);
  check_level(refiner);
  total = 0;
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    if (keep[v]) {
      double now[3];
      orb_refiner_point(refiner, v, now);
      assert_memory_equal(now, held[total], sizeof now);
      total++;
    }
  }
  orb_free(ctx, vertices);
  orb_free(ctx, triangles);
  free(keep);
  orb_refiner_destroy(ctx, refiner);
  orb_hierarchy_destroy(ctx, hierarchy);
  shape_free(ctx, &mesh);
}

/* Each instruction set embeds validly and to the same quality. */
static void test_vector_loops(void **unused) {
  (void)unused;
  orb_mesh mesh = bumpy(5);
  double *points = malloc(24 * (size_t)mesh.vertex_count), first = 0;
  assert_non_null(points);
  for (orb_cpu cpu = ORB_CPU_PLAIN; cpu <= orb_context_cpu(ctx); cpu++) {
    orb_context *narrow;
    orb_context_options options = {.threads = 2, .cpu = cpu};
    assert_int_equal(orb_context_create(&options, &narrow), ORB_OK);
    assert_int_equal(orb_context_cpu(narrow), cpu);
    orb_embedding embedding;
    assert_int_equal(orb_embed(narrow, &mesh, NULL, &embedding), ORB_OK);
    memcpy(points, embedding.points, 24 * (size_t)mesh.vertex_count);
    orb_embedding_free(narrow, &embedding);
    orb_context_destroy(narrow);
    orb_certificate certificate;
    assert_int_equal(orb_certify(ctx, points, mesh.vertex_count, mesh.triangles, mesh.triangle_count, &certificate),
                     ORB_OK);
    assert_true(certificate.valid);
    orb_distortion distortion;
    assert_int_equal(
        orb_distortion_measure(ctx, mesh.positions, points, mesh.triangles, mesh.triangle_count, &distortion), ORB_OK);
    double mean = distortion.symmetric_dirichlet.mean;
    print_message("%s: %.6f\n", orb_vector_loops_of(cpu)->name, mean);
    first = cpu == ORB_CPU_PLAIN ? mean : first;
    assert_true(fabs(mean - first) < 0.05 * first);
  }
  free(points);
  shape_free(ctx, &mesh);
}

/* Ever thinner rings that are a fan from their first point: the search finds a point, which is exactly inside. */
static void test_kernel_point(void **unused) {
  (void)unused;
  orb_kernel_room room = {0};
  uint32_t seed = 7;
  int found_all = 0, tried = 0;
  for (int i = 0; i < 3000; i++) {
    double ring[40][3], thin = pow(10, -(i % 12));
    int count = 3 + i % 37;
    for (int j = 0; j < count; j++) { /* all other points lie ahead of ring[0], in angular order, at any distance */
      seed = seed * 1664525U + 1013904223U;
      double angle = 3.0 * (j - 1) / count * (i % 3 ? thin : 1), far = 0.01 + seed / 4294967296.0 * 0.4;
      double x = j ? far * cos(angle) : 0, y = j ? far * sin(angle) : 0, length = sqrt(1 + x * x + y * y);
      ring[j][0] = x / length;
      ring[j][1] = y / length;
      ring[j][2] = 1 / length;
    }
    int fan = 1;
    for (int j = 1; j + 1 < count; j++) {
      fan &= exact_orientation(ring[0], ring[j], ring[j + 1]) > 0;
    }
    if (fan) {
      double p[3];
      int found;
      assert_int_equal(orb_kernel_point(ctx, &room, (const double(*)[3])ring, count, p, &found), ORB_OK);
      tried++;
      found_all += found;
      for (int j = 0; found && j < count; j++) {
        assert_int_equal(exact_orientation(p, ring[j], ring[(j + 1) % count]), 1);
      }
    }
  }
  orb_kernel_room_free(ctx, &room);
  assert_true(tried > 2500);
  assert_int_equal(found_all, tried);
}

/* Maps with known singular values: the plane stretched by (s, t). */
static void test_distortion(void **unused) {
  (void)unused;
  enum { N = 5000 };
  double *from = malloc(9 * N * sizeof(double)), *to = malloc(9 * N * sizeof(double));
  int32_t *triangles = malloc(3 * N * sizeof(int32_t));
  assert_true(from && to && triangles);
  uint32_t seed = 99;
  for (int i = 0; i < 9 * N; i++) {
    seed = seed * 1664525U + 1013904223U;
    from[i] = i % 3 == 2 ? 0 : seed / 4294967296.0;
    to[i] = from[i] * (i % 3 == 0 ? 6.0 : 1.5); /* singular values 6 and 1.5: after scaling 2 and ½ */
  }
  for (int i = 0; i < 3 * N; i++) {
    triangles[i] = i;
  }
  orb_distortion d;
  assert_int_equal(orb_distortion_measure(ctx, from, to, triangles, N, &d), ORB_OK);
  double dirichlet = 0.25 * (4 + 0.25 + 0.25 + 4);
  assert_near(d.symmetric_dirichlet.mean, dirichlet, 1e-9);
  assert_near(d.symmetric_dirichlet.median, dirichlet, 1e-6);
  assert_near(d.symmetric_dirichlet.p99, dirichlet, 1e-6);
  assert_near(d.angle.mean, 4, 1e-9);
  assert_near(d.area.mean, 0, 1e-9);
  assert_true(d.area.std < 1e-6);
  assert_near(d.stretch_efficiency, 1 / (0.5 * (0.25 + 4)), 1e-9);
  /* Half of the area is stretched by another factor: weighted percentiles and the spread of area. */
  for (int i = 0; i < 9 * N; i++) {
    from[i] = i % 9 < 3 ? 0 : i % 9 < 6 ? i % 3 == 0 : i % 3 == 1;
    to[i] = from[i] * (i / 9 < N / 4 ? 3 : 1);
  }
  assert_int_equal(orb_distortion_measure(ctx, from, to, triangles, N, &d), ORB_OK);
  double share = 0.25, all = share * 9 + 1 - share, small = log(1 / all), large = log(9 / all);
  double mean = share * large + (1 - share) * small;
  assert_near(d.area.mean, mean, 1e-9);
  assert_near(d.area.median, small, 1e-9);
  assert_near(d.area.p99, large, 1e-9);
  assert_near(d.area.max, large, 1e-9);
  assert_near(d.area.std, sqrt(share * (1 - share)) * log(9), 1e-9);
  assert_near(d.angle.max, 1, 1e-6);
  double counted = 0;
  for (int i = 0; i < d.area.bins; i++) {
    assert_true(d.area.edges[i] < d.area.edges[i + 1]);
    counted += d.area.counts[i];
  }
  assert_near(counted, N, 0);
  free(from);
  free(to);
  free(triangles);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_levels),       cmocka_unit_test(test_again),
                                     cmocka_unit_test(test_keep_and_pin), cmocka_unit_test(test_vector_loops),
                                     cmocka_unit_test(test_kernel_point), cmocka_unit_test(test_distortion)};
  return cmocka_run_group_tests(tests, context_two_threads, context_end);
}
