/* The paper's method is valid, optimisation lowers Eq. 3, the exponents act as in Fig. 16, and a repeat gives the same
 * bytes. */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "embed/kernel_sampling/kernel_sampling.h"
#include "embed/kernel_sampling/search.h"
#include "embed/kernel_sampling/simplify.h"
#include "support_exact.h"
#include "support_failing.h"
#include "support_shapes.h"

static orb_context *open_context(int threads) {
  orb_context *ctx;
  orb_context_options options = {.threads = threads};
  assert_int_equal(orb_context_create(&options, &ctx), ORB_OK);
  return ctx;
}

static orb_embed_options sampling(void) {
  orb_embed_options options;
  orb_embed_defaults(&options);
  options.method = ORB_EMBED_KERNEL_SAMPLING;
  return options;
}

/* A ball with two limbs, which the sphere has to compress. */
static orb_mesh limbed(orb_context *ctx, int levels) {
  orb_mesh mesh = shape_ball(ctx, levels);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    double *p = mesh.positions + 3 * v, up = p[2] > 0.8 ? 1 + 12 * (p[2] - 0.8) : 1,
           side = p[0] > 0.85 ? 1 + 8 * (p[0] - 0.85) : 1;
    for (int k = 0; k < 3; k++) {
      p[k] *= up * side;
    }
  }
  return mesh;
}

static orb_embedding embed(orb_context *ctx, const orb_mesh *mesh, const orb_embed_options *options) {
  orb_embedding out;
  orb_status status = orb_embed(ctx, mesh, options, &out);
  if (status != ORB_OK) {
    print_message("%s\n", orb_context_error(ctx)->detail);
  }
  assert_int_equal(status, ORB_OK);
  return out;
}

static void test_valid(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(1);
  orb_embed_options options = sampling();
  orb_mesh list[] = {shape_tetrahedron(ctx),          shape_octahedron(ctx), shape_icosahedron(ctx), limbed(ctx, 4),
                     shape_cylinder(ctx, 12, 60, 40), shape_ball(ctx, 3),    shape_globe(ctx, 24, 6)};
  for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
    orb_embedding e = embed(ctx, &list[i], &options);
    assert_true(e.certificate.valid && e.certificate.exact && e.certificate.degree == 1);
    for (int32_t v = 0; v < list[i].vertex_count; v++) {
      const double *p = e.points + 3 * v;
      assert_true(fabs(sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - 1) < 1e-12);
    }
    for (int32_t t = 0; t < list[i].triangle_count; t += list[i].triangle_count / 200 + 1) {
      const int32_t *v = list[i].triangles + 3 * t;
      assert_int_equal(exact_orientation(e.points + 3 * v[0], e.points + 3 * v[1], e.points + 3 * v[2]), 1);
    }
    assert_true(e.timings.total >= e.timings.simplify + e.timings.embed);
    orb_embedding_free(ctx, &e);
    shape_free(ctx, &list[i]);
  }
  orb_context_destroy(ctx);
}

/* The method also embeds meaningless positions and coincident vertices. */
static void test_degenerate(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(1);
  orb_embed_options options = sampling();
  orb_mesh mesh = shape_ball(ctx, 3);
  for (int32_t v = 0; v < mesh.vertex_count; v++) {
    mesh.positions[3 * v + 2] = 0; /* flat */
  }
  orb_embedding e = embed(ctx, &mesh, &options);
  assert_true(e.certificate.valid);
  orb_embedding_free(ctx, &e);
  for (int32_t v = 0; v < 3 * mesh.vertex_count; v++) {
    mesh.positions[v] = 7;
  }
  e = embed(ctx, &mesh, &options);
  assert_true(e.certificate.valid);
  orb_embedding_free(ctx, &e);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

/* Eq. 3, term by term from its definition: cotangents, areas, circumradius over twice the inradius. */
static double error_by_definition(const double (*ring)[3], int count, const double p[3], const double *mesh_edge2,
                                  double mesh_area, double carried, double rho, double phi) {
  double sum = 0;
  for (int i = 0; i < count; i++) {
    const double *at[3] = {p, ring[i], ring[(i + 1) % count]};
    double length[3], cotangents = 0, area, s = 0;
    for (int k = 0; k < 3; k++) { /* side k is opposite to corner k */
      const double *a = at[(k + 1) % 3], *b = at[(k + 2) % 3];
      length[k] = sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
      s += 0.5 * length[k];
    }
    area = sqrt(s * (s - length[0]) * (s - length[1]) * (s - length[2])); /* Heron */
    for (int k = 0; k < 3; k++) {
      double a = length[k], b = length[(k + 1) % 3], c = length[(k + 2) % 3];
      double angle = acos((b * b + c * c - a * a) / (2 * b * c));
      cotangents += mesh_edge2[k] / tan(angle);
    }
    double circumradius = length[0] * length[1] * length[2] / (4 * area), inradius = area / s;
    sum += cotangents / (2 * mesh_area) * pow(area / carried + carried / area, rho) *
           pow(circumradius / (2 * inradius), phi);
  }
  return sum;
}

/* An octahedron with one vertex moved: the ring of its neighbour is measured and searched. */
static void test_error(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(1);
  orb_mesh mesh = shape_octahedron(ctx);
  orb_ks_mesh m;
  orb_ks_sampler s;
  orb_embed_options options = sampling();
  assert_int_equal(orb_ks_mesh_create(ctx, &mesh, mesh.positions, &m), ORB_OK);
  double edge2[3] = {2, 2, 2}, one = 0.5 * sqrt(3), carried = 4 * M_PI / 8; /* of a unit octahedron */
  static const double exponents[][2] = {{3, 12}, {3, 1}, {1.5, 6}, {2, 0}, {0, 0}, {2.5, 7.3}};
  for (size_t i = 0; i < sizeof exponents / sizeof exponents[0]; i++) {
    options.area_exponent = exponents[i][0];
    options.aspect_exponent = exponents[i][1];
    assert_int_equal(orb_ks_sampler_create(ctx, &options, &s), ORB_OK);
    assert_int_equal(orb_ks_ring_load(ctx, &s, &m, mesh.positions, 0), ORB_OK);
    double p[3], found[3] = {0}, error = 0, present;
    memcpy(p, mesh.positions, sizeof p);
    p[0] += 0.21;
    p[1] -= 0.17;
    p[2] += 0.19;
    double length = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    for (int k = 0; k < 3; k++) {
      p[k] /= length;
    }
    present = orb_ks_error_at(&s, p);
    double expected = error_by_definition((const double(*)[3])s.ring.point, s.ring.count, p, edge2, one, carried,
                                          exponents[i][0], exponents[i][1]);
    /* The angle term of the definition has no floor on the mesh's area; the floor changes it by 1 %. */
    assert_true(fabs(present / expected - 1) < 0.02);
    for (orb_cpu cpu = ORB_CPU_PLAIN; cpu <= orb_context_cpu(ctx); cpu++) {
      double out[3], e;
      s.cpu = cpu;
      int better = orb_ks_search(&s, p, 1, present, out, &e);
      assert_true(better && e < present);
      assert_true(fabs(e - orb_ks_error_at(&s, out)) <= 1e-12 * e);
      if (cpu > ORB_CPU_PLAIN) { /* the same bits for every width */
        assert_memory_equal(out, found, sizeof out);
        assert_true(e == error);
      }
      memcpy(found, out, sizeof out);
      error = e;
    }
    /* Two independent searches, in double and in single precision, over the same samples. */
    double best[3], least;
    assert_int_equal(orb_ks_best_sample(&s, p, 0, s.ring.count, 1, INFINITY, best, &least), 1);
    assert_true(fabs(error / least - 1) < 1e-3);
    orb_ks_sampler_free(ctx, &s);
  }
  orb_ks_mesh_free(ctx, &m);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

/* A split undoes a collapse to the bit, areas included. */
static void test_mesh_undo(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(1);
  orb_mesh mesh = limbed(ctx, 3);
  orb_ks_mesh m;
  assert_int_equal(orb_ks_mesh_create(ctx, &mesh, mesh.positions, &m), ORB_OK);
  size_t corners = 3 * (size_t)m.triangle_count;
  int32_t *tri = test_malloc(corners * sizeof *tri), *twin = test_malloc(corners * sizeof *twin);
  double *area = test_malloc((size_t)m.triangle_count * sizeof *area), total = 0;
  memcpy(tri, m.tri, corners * sizeof *tri);
  memcpy(twin, m.twin, corners * sizeof *twin);
  memcpy(area, m.area, (size_t)m.triangle_count * sizeof *area);
  for (int32_t t = 0; t < m.triangle_count; t++) {
    total += area[t];
  }
  assert_true(fabs(total - 4 * M_PI) < 1e-9);
  assert_int_equal(orb_ks_simplify(ctx, &m, 200), ORB_OK);
  assert_int_equal(m.live, 4);
  double left = 0;
  for (int32_t t = 0; t < m.triangle_count; t++) { /* of the tetrahedron: each corner's out-edges are alive */
    int alive = 1;
    for (int k = 0; k < 3; k++) {
      alive &= m.valence[m.tri[3 * t + k]] > 0 && m.twin[m.twin[3 * t + k]] == 3 * t + k;
    }
    left += alive ? m.area[t] : 0;
  }
  assert_true(fabs(left - 4 * M_PI) < 1e-9);
  while (m.live < m.vertex_count) {
    orb_ks_split_last(&m);
  }
  assert_memory_equal(tri, m.tri, corners * sizeof *tri);
  assert_memory_equal(twin, m.twin, corners * sizeof *twin);
  assert_memory_equal(area, m.area, (size_t)m.triangle_count * sizeof *area);
  test_free(tri);
  test_free(twin);
  test_free(area);
  orb_ks_mesh_free(ctx, &m);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

/* Fig. 16: a higher area exponent keeps areas better, a higher aspect exponent shapes. */
static void test_exponents(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(1);
  orb_mesh mesh = limbed(ctx, 4);
  orb_embed_options options = sampling();
  double spread[2], shape[2];
  for (int i = 0; i < 2; i++) {
    options.area_exponent = i ? 3 : 1.5;
    options.aspect_exponent = 6;
    orb_embedding e = embed(ctx, &mesh, &options);
    spread[i] = e.distortion.area.std;
    orb_embedding_free(ctx, &e);
    options.area_exponent = 2;
    options.aspect_exponent = i ? 12 : 0;
    e = embed(ctx, &mesh, &options);
    shape[i] = e.distortion.aspect.mean;
    orb_embedding_free(ctx, &e);
  }
  print_message("area std %.3f -> %.3f, aspect %.3f -> %.3f\n", spread[0], spread[1], shape[0], shape[1]);
  assert_true(spread[1] < spread[0]);
  assert_true(shape[1] < shape[0]);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

static void test_same_bytes(void **unused) {
  (void)unused;
  static const int threads[] = {1, 2, 3, 8, 1};
  orb_embed_options options = sampling();
  double *first = NULL;
  size_t size = 0;
  for (int i = 0; i < 5; i++) {
    orb_context *ctx = open_context(threads[i]);
    orb_mesh mesh = limbed(ctx, 3);
    orb_embedding e = embed(ctx, &mesh, &options);
    size = 3 * sizeof(double) * (size_t)mesh.vertex_count;
    if (!first) {
      first = test_malloc(size);
      memcpy(first, e.points, size);
    }
    assert_memory_equal(first, e.points, size);
    orb_embedding_free(ctx, &e);
    shape_free(ctx, &mesh);
    orb_context_destroy(ctx);
  }
  test_free(first);
}

static void cancel_in_embed(void *user, const char *stage, double fraction) {
  (void)fraction;
  if (strcmp(stage, "embed") == 0) {
    orb_context_cancel(*(orb_context **)user);
  }
}

static void test_cancel(void **unused) {
  (void)unused;
  orb_context *ctx = NULL;
  orb_context_options setup = {.threads = 1, .progress = cancel_in_embed, .progress_user = &ctx};
  assert_int_equal(orb_context_create(&setup, &ctx), ORB_OK);
  orb_mesh mesh = limbed(ctx, 4);
  orb_embed_options options = sampling();
  orb_embedding e;
  assert_int_equal(orb_embed(ctx, &mesh, &options, &e), ORB_E_CANCELLED);
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

static void test_memory(void **unused) {
  (void)unused;
  orb_embed_options options = sampling();
  int succeeded = 0;
  for (size_t limit = 2000; !succeeded; limit += limit / 4) {
    orb_context *ctx;
    orb_context_options setup = {.threads = 1, .memory_limit = limit};
    assert_int_equal(orb_context_create(&setup, &ctx), ORB_OK);
    orb_context *roomy = open_context(1);
    orb_mesh mesh = limbed(roomy, 2);
    orb_embedding e;
    orb_status status = orb_embed(ctx, &mesh, &options, &e);
    assert_true(status == ORB_OK || status == ORB_E_NO_MEMORY);
    if (status == ORB_OK) {
      succeeded = 1;
      orb_embedding_free(ctx, &e);
    }
    shape_free(roomy, &mesh);
    orb_context_destroy(roomy);
    orb_context_destroy(ctx);
  }
}

/* Each allocation fails once: both phases of the simplification, rings that outgrow their buffers, sweeps. */
static void test_every_allocation(void **unused) {
  (void)unused;
  orb_context *plain = open_context(1);
  orb_mesh mesh = shape_globe(plain, 40, 3); /* ring sizes from 3 to 40 */
  orb_embed_options options = sampling();
  options.qem_until = 30;
  options.step = 0.2;
  options.max_iterations = 4;
  int failures = failing_embeds(&mesh, &options);
  print_message("%d allocations failed\n", failures);
  assert_true(failures > 40);
  shape_free(plain, &mesh);
  orb_context_destroy(plain);
}

/* One search takes at most KS_WORK samples times planes for any step and ring, or the samples of 8 triangles. */
static void test_search_is_bounded(void **unused) {
  (void)unused;
  static const double steps[] = {0.01, 0.03, 0.11, 0.33};
  orb_context *ctx = open_context(1);
  for (int i = 0; i < 4; i++) {
    orb_embed_options options = sampling();
    options.step = steps[i];
    orb_ks_sampler s;
    assert_int_equal(orb_ks_sampler_create(ctx, &options, &s), ORB_OK);
    for (int32_t ring = 3; ring < 1000000; ring += 1 + ring / 3) {
      int64_t stride = orb_ks_stride(&s, ring), sampled = (ring + stride - 1) / stride;
      assert_true(sampled >= 1 && sampled <= KS_WHOLE_RING);
      assert_true(sampled <= 8 || sampled * s.padded_count * ring <= KS_WORK);
    }
    orb_ks_sampler_free(ctx, &s);
  }
  orb_context_destroy(ctx);
}

/* Poles: an embedding, or a refusal that says what to do, after at most three attempts of bounded optimisation. */
static void test_poles(void **unused) {
  (void)unused;
  static const int around[] = {200, 200, 2000, 2000}, rows[] = {2, 6, 2, 6};
  orb_context *ctx = open_context(1);
  orb_embed_options options = sampling();
  for (int i = 0; i < 4; i++) {
    orb_mesh mesh = shape_globe(ctx, around[i], rows[i]);
    size_t n = (size_t)mesh.vertex_count;
    double *points = test_malloc(3 * n * sizeof *points);
    orb_ks_report report = {0};
    orb_status status = orb_kernel_sampling(ctx, &mesh, &options, points, &report);
    /* Intervals start at 25 and grow by 1.25: this many executions insert all vertices. */
    int executions = 1 + (int)(log(1 + (double)n / 25) / log(1.25)) + 3;
    assert_in_range(report.attempts, 1, 3);
    assert_true(report.executions <= report.attempts * executions);
    assert_true(report.iterations <= options.max_iterations);
    if (status == ORB_OK) {
      orb_certificate certificate;
      assert_int_equal(orb_certify(ctx, points, mesh.vertex_count, mesh.triangles, mesh.triangle_count, &certificate),
                       ORB_OK);
      assert_true(certificate.valid);
    } else {
      assert_int_equal(status, ORB_E_NOT_CERTIFIED);
      assert_non_null(strstr(orb_context_error(ctx)->detail, "use the method newton"));
    }
    assert_true(i > 0 || status == ORB_OK); /* two poles of valence 200 with one ring between them */
    print_message("valence %d, %zu vertices: %s\n", around[i], n, status == ORB_OK ? "valid" : "refused");
    test_free(points);
    shape_free(ctx, &mesh);
  }
  orb_context_destroy(ctx);
}

static void test_options(void **unused) {
  (void)unused;
  orb_context *ctx = open_context(1);
  orb_mesh mesh = shape_icosahedron(ctx);
  for (int i = 0; i < 6; i++) {
    orb_embed_options options = sampling();
    options.step = i == 0 ? 0 : i == 1 ? NAN : options.step;
    options.growth = i == 2 ? 1 : options.growth;
    options.max_iterations = i == 3 ? 0 : options.max_iterations;
    options.area_exponent = i == 4 ? -1 : options.area_exponent;
    options.first_optimization = i == 5 ? 0 : options.first_optimization;
    orb_embedding e;
    assert_int_equal(orb_embed(ctx, &mesh, &options, &e), ORB_E_BAD_OPTION);
  }
  shape_free(ctx, &mesh);
  orb_context_destroy(ctx);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_valid),
      cmocka_unit_test(test_degenerate),
      cmocka_unit_test(test_error),
      cmocka_unit_test(test_mesh_undo),
      cmocka_unit_test(test_exponents),
      cmocka_unit_test(test_same_bytes),
      cmocka_unit_test(test_cancel),
      cmocka_unit_test(test_memory),
      cmocka_unit_test(test_options),
      cmocka_unit_test(test_every_allocation),
      cmocka_unit_test(test_search_is_bounded),
      cmocka_unit_test(test_poles),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
