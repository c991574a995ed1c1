/* Repairs and refusals on small solids whose topology is known. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "numeric/vec3.h"
#include "orbmorph/format.h"
#include "support_context.h"
#include "support_remesh.h"
#include "support_shapes.h"

static orb_status read_repaired(const char *text, unsigned repair, orb_mesh *mesh) {
  assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)text, strlen(text), ORB_FORMAT_OBJ, mesh, NULL), ORB_OK);
  orb_status status = orb_mesh_repair(ctx, mesh, repair);
  if (status != ORB_OK) {
    orb_mesh_free(ctx, mesh);
  }
  return status;
}

#define TETRA_V "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
#define TETRA_F "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

static void test_safe(void **state) {
  (void)state;
  orb_mesh mesh;
  orb_extent extent;
  assert_int_equal(read_repaired(TETRA_V TETRA_F, ORB_REPAIR_NONE, &mesh), ORB_OK);
  assert_int_equal(mesh.repair_count, 0);
  orb_mesh_free(ctx, &mesh);

  /* inside out: reversed, also without a repair */
  assert_int_equal(read_repaired(TETRA_V "f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n", ORB_REPAIR_NONE, &mesh), ORB_OK);
  assert_int_equal(shape_repaired(&mesh, "turn-inside-out"), 4);
  orb_mesh_extent(&mesh, &extent);
  assert_true(fabs(extent.volume - 1.0 / 6) < 1e-15);
  orb_mesh_free(ctx, &mesh);

  /* one face reversed, one repeated, one degenerate, one vertex unused (before the others: numbers move) */
  const char *messy = "v 9 9 9\n" TETRA_V "f 2 4 3\nf 2 3 5\nf 2 4 5\nf 3 4 5\nf 5 4 3\nf 2 2 3\n";
  assert_int_equal(read_repaired(messy, ORB_REPAIR_NONE, &mesh), ORB_E_NOT_MANIFOLD);
  assert_int_equal(read_repaired(messy, ORB_REPAIR_SAFE, &mesh), ORB_OK);
  assert_int_equal(shape_repaired(&mesh, "reorient"), 1);
  assert_int_equal(shape_repaired(&mesh, "duplicate-faces"), 1);
  assert_int_equal(shape_repaired(&mesh, "degenerate-faces"), 1);
  assert_int_equal(shape_repaired(&mesh, "unused-vertices"), 1);
  assert_int_equal(mesh.vertex_of_source[0], -1);
  assert_int_equal(mesh.vertex_of_source[1], 0);
  assert_int_equal(mesh.source[3], 4);
  orb_mesh_extent(&mesh, &extent);
  assert_true(fabs(extent.volume - 1.0 / 6) < 1e-15);
  orb_mesh_free(ctx, &mesh);

  /* a seam with −0 against 0 */
  const char *seam = TETRA_V "v -0 0 -0\nv 1 -0 0\nf 5 3 6\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  assert_int_equal(read_repaired(seam, ORB_REPAIR_SAFE, &mesh), ORB_OK);
  assert_int_equal(shape_repaired(&mesh, "weld"), 2);
  assert_int_equal(mesh.vertex_count, 4);
  assert_int_equal(mesh.vertex_of_source[4], 0);
  assert_int_equal(mesh.vertex_of_source[5], 1);
  orb_mesh_free(ctx, &mesh);
}

/* Eight corners, six quadrangles; with `loose` each face has corners of its own. */
static void cube(char *out, size_t *length, double x, double y, int first, int loose) {
  static const int face[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  char *p = out + *length;
  for (int i = 0; i < (loose ? 24 : 8); i++) {
    int c = loose ? face[i / 4][i % 4] : i;
    p += sprintf(p, "v %g %g %d\n", x + (c & 1), y + (c >> 1 & 1), c >> 2);
  }
  for (int f = 0; f < 6; f++) {
    p += sprintf(p, "f");
    for (int k = 0; k < 4; k++) {
      p += sprintf(p, " %d", first + (loose ? 4 * f + k : face[f][k]));
    }
    p += sprintf(p, "\n");
  }
  *length = (size_t)(p - out);
}

static void test_welding_of_cubes(void **state) {
  (void)state;
  char text[8192];
  size_t length = 0;
  orb_mesh mesh;
  cube(text, &length, 0, 0, 1, 1);
  assert_int_equal(read_repaired(text, ORB_REPAIR_SAFE, &mesh), ORB_OK);
  assert_int_equal(mesh.vertex_count, 8);
  assert_int_equal(mesh.triangle_count, 12);
  assert_int_equal(shape_repaired(&mesh, "weld"), 16);
  orb_mesh_free(ctx, &mesh);

  /* two loose cubes that touch along an edge stay two cubes */
  cube(text, &length, 1, 1, 25, 1);
  assert_int_equal(read_repaired(text, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_CONNECTED);
  assert_int_equal(orb_context_error(ctx)->component_total, 2);
  assert_int_equal(orb_context_error(ctx)->components[0], 12);
  assert_int_equal(read_repaired(text, ORB_REPAIR_LARGEST_COMPONENT, &mesh), ORB_OK);
  assert_int_equal(mesh.vertex_count, 8);
  orb_mesh_free(ctx, &mesh);

  /* closed ones that touch are not welded at all */
  length = 0;
  cube(text, &length, 0, 0, 1, 0);
  cube(text, &length, 1, 0, 9, 0);
  assert_int_equal(read_repaired(text, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_CONNECTED);
}

static void test_refusals(void **state) {
  (void)state;
  orb_mesh mesh;
  const orb_error *error = orb_context_error(ctx);
  assert_int_equal(read_repaired("v 7 7 7\n" TETRA_V "f 2 4 3\nf 2 3 5\nf 2 5 4\n", ORB_REPAIR_SAFE, &mesh),
                   ORB_E_NOT_CLOSED);
  assert_int_equal(error->boundary_loops, 1);
  assert_int_equal(error->edge_count, 3);
  for (int i = 0; i < 3; i++) { /* the rim is 2 3 4, counted from 0 in the file */
    assert_true(error->edges[i][0] >= 2 && error->edges[i][1] >= 2);
  }
  /* two faces back to back: one stays */
  assert_int_equal(read_repaired(TETRA_V "f 1 2 3\nf 1 3 2\n", ORB_REPAIR_SAFE, &mesh), ORB_E_DEGENERATE);
  assert_int_equal(read_repaired(TETRA_V "f 1 1 2\n", ORB_REPAIR_SAFE, &mesh), ORB_E_DEGENERATE);
  assert_int_equal(read_repaired(TETRA_V "f 1 3 2\nf 1 2 4\nf 1 3 4\nf 2 3 4\n", ORB_REPAIR_NONE, &mesh),
                   ORB_E_NOT_ORIENTABLE);
  /* an edge of three faces */
  assert_int_equal(read_repaired(TETRA_V "v 5 5 5\n" TETRA_F "f 1 2 5\n", ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_MANIFOLD);
  assert_int_equal(error->edge_count, 1);
  assert_true((error->edges[0][0] == 0 && error->edges[0][1] == 1) ||
              (error->edges[0][0] == 1 && error->edges[0][1] == 0));
  /* two tetrahedra that share vertex 0 only */
  const char *pinched = TETRA_V "v -1 0 0\nv 0 -1 0\nv 0 0 -1\n" TETRA_F "f 1 5 6\nf 1 7 5\nf 1 6 7\nf 5 7 6\n";
  assert_int_equal(read_repaired(pinched, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_MANIFOLD);
  assert_int_equal(error->vertices[0], 0);
  assert_int_equal(error->component_total, 2);
  assert_int_equal(read_repaired(pinched, ORB_REPAIR_LARGEST_COMPONENT, &mesh), ORB_OK);
  orb_mesh_free(ctx, &mesh);
}

/* An object that is joined to a larger one names their piece too. */
static void test_part_of_piece(void **state) {
  (void)state;
  const char *text = TETRA_V
      "o body\nf 1 3 2\nf 1 2 4\nf 1 4 3\no head\nf 2 3 4\no eye\n"
      "v 9 0 0\nv 10 0 0\nv 9 1 0\nv 9 0 1\nf 5 7 6\nf 5 6 8\nf 5 8 7\nf 6 7 8\n";
  static const struct {
    const char *name;
    int first;
  } cases[] = {{"body", 0}, {"head", 0}, {"eye", 4}, {"hat", -1}};
  orb_mesh one;
  const orb_repair_options fifth = {.repair = ORB_REPAIR_PART, .part = 5};
  assert_int_equal(
      orb_mesh_read(ctx, (const unsigned char *)TETRA_V TETRA_F, strlen(TETRA_V TETRA_F), ORB_FORMAT_OBJ, &one, NULL),
      ORB_OK);
  assert_int_equal(orb_mesh_repair_with(ctx, &one, &fifth), ORB_E_BAD_OPTION); /* connected */
  orb_mesh_free(ctx, &one);
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    orb_mesh mesh;
    orb_repair_options options = {.repair = ORB_REPAIR_PART};
    strcpy(options.part_name, cases[i].name);
    assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)text, strlen(text), ORB_FORMAT_OBJ, &mesh, NULL),
                     ORB_OK);
    orb_status status = orb_mesh_repair_with(ctx, &mesh, &options);
    assert_int_equal(status, cases[i].first < 0 ? ORB_E_NOT_CONNECTED : ORB_OK);
    if (status == ORB_OK) {
      assert_int_equal(mesh.triangle_count, 4);
      assert_int_equal(mesh.source[0], cases[i].first);
    }
    orb_mesh_free(ctx, &mesh);
  }
}

/* Pieces by number and by name; the first two have names in the file. */
static void test_parts(void **state) {
  (void)state;
  char text[8192], *p = text;
  size_t length = 0;
  p += sprintf(p, "o head of it\n" TETRA_V TETRA_F "g ignored\no body\n");
  cube(p, &length, 10, 0, 5, 0);
  p += length;
  p +=
      sprintf(p, "o caf\xe9\nv 20 0 0\nv 21 0 0\nv 20 1 0\nv 20 0 1\nf 13 15 14\nf 13 14 16\nf 13 16 15\nf 14 15 16\n");
  orb_mesh mesh;
  const orb_error *error = orb_context_error(ctx);
  assert_int_equal(read_repaired(text, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_CONNECTED);
  assert_int_equal(error->component_count, 3);
  assert_string_equal(error->component_names[0], "body");
  assert_string_equal(error->component_names[1], "head of it");
  assert_string_equal(error->component_names[2], "caf?");
  static const struct {
    const char *name;
    int part, triangles, first;
  } cases[] = {{"", 0, 12, 4}, {"", 1, 4, 0}, {"", 2, 4, 12}, {"head of it", 0, 4, 0}, {"body", 7, 12, 4}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    orb_repair_options options = {.repair = ORB_REPAIR_PART, .part = cases[i].part};
    strcpy(options.part_name, cases[i].name);
    assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)text, strlen(text), ORB_FORMAT_OBJ, &mesh, NULL),
                     ORB_OK);
    assert_int_equal(orb_mesh_repair_with(ctx, &mesh, &options), ORB_OK);
    assert_int_equal(mesh.triangle_count, cases[i].triangles);
    assert_int_equal(mesh.source[0], cases[i].first);
    assert_int_equal(shape_repaired(&mesh, "part"), 2);
    orb_mesh_free(ctx, &mesh);
  }
  for (int i = 0; i < 2; i++) {
    orb_repair_options options = {.repair = ORB_REPAIR_PART, .part = 3};
    strcpy(options.part_name, i ? "ignored" : "");
    assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)text, strlen(text), ORB_FORMAT_OBJ, &mesh, NULL),
                     ORB_OK);
    assert_int_equal(orb_mesh_repair_with(ctx, &mesh, &options), ORB_E_NOT_CONNECTED);
    assert_non_null(strstr(error->detail, i ? "\"ignored\"" : "no part 3, but 3 parts"));
    orb_mesh_free(ctx, &mesh);
  }
}

/* A torus of n × n quadrangles: genus one. */
static void test_torus(void **state) {
  (void)state;
  enum { N = 12 };
  char text[65536], *p = text;
  for (int i = 0; i < N * N; i++) {
    double a = 2 * M_PI * (i / N) / N, b = 2 * M_PI * (i % N) / N;
    p += sprintf(p, "v %.9f %.9f %.9f\n", (3 + cos(b)) * cos(a), (3 + cos(b)) * sin(a), sin(b));
  }
  for (int i = 0; i < N * N; i++) {
    int r = i / N, c = i % N, d = (r + 1) % N, e = (c + 1) % N;
    p += sprintf(p, "f %d %d %d %d\n", r * N + c + 1, d * N + c + 1, d * N + e + 1, r * N + e + 1);
  }
  orb_mesh mesh;
  orb_topology topology;
  assert_int_equal(orb_mesh_read(ctx, (unsigned char *)text, (size_t)(p - text), ORB_FORMAT_AUTO, &mesh, NULL), ORB_OK);
  assert_int_equal(orb_mesh_topology(ctx, &mesh, &topology), ORB_OK);
  assert_true(topology.genus == 1 && topology.components == 1 && topology.boundary_loops == 0);
  assert_int_equal(orb_mesh_repair(ctx, &mesh, ORB_REPAIR_SAFE), ORB_E_NOT_GENUS_ZERO);
  assert_int_equal(orb_context_error(ctx)->genus, 1);
  orb_mesh_free(ctx, &mesh);
}

/* A sphere of rings without its caps: two loops; filled, its volume is that of the polyhedron with flat caps. */
static void test_fill(void **state) {
  (void)state;
  for (int n = 5; n < 50; n += 40) {
    static char text[65536];
    char *p = text;
    for (int i = 0; i < 2 * n; i++) {
      double a = 2 * M_PI * (i % n) / n;
      p += sprintf(p, "v %.17g %.17g %d\n", cos(a), sin(a), i / n);
    }
    for (int i = 0; i < n; i++) {
      int j = (i + 1) % n;
      p += sprintf(p, "f %d %d %d %d\n", i + 1, j + 1, n + j + 1, n + i + 1);
    }
    orb_mesh mesh;
    orb_extent extent;
    assert_int_equal(read_repaired(text, ORB_REPAIR_SAFE, &mesh), ORB_E_NOT_CLOSED);
    assert_int_equal(orb_context_error(ctx)->boundary_loops, 2);
    assert_int_equal(read_repaired(text, ORB_REPAIR_FILL_HOLES, &mesh), ORB_OK);
    assert_int_equal(shape_repaired(&mesh, "fill_holes"), 2);
    assert_int_equal(mesh.triangle_count, 2 * n + 2 * (n - 2));
    orb_mesh_extent(&mesh, &extent);
    assert_true(fabs(extent.volume - 0.5 * n * sin(2 * M_PI / n)) < 1e-12); /* a prism of height 1 */
    orb_mesh_free(ctx, &mesh);
  }
}

/* The triangles of a ball for which `keep` is true, as OBJ; free() it. */
static char *cut_ball(int levels, int (*keep)(const double *)) {
  orb_mesh ball = shape_ball(ctx, levels);
  char *text = malloc(80 * (size_t)(ball.vertex_count + ball.triangle_count)), *p = text;
  assert_non_null(text);
  for (int32_t v = 0; v < ball.vertex_count; v++) {
    const double *x = ball.positions + 3 * v;
    p += sprintf(p, "v %.17g %.17g %.17g\n", x[0], x[1], x[2]);
  }
  for (int32_t t = 0; t < ball.triangle_count; t++) {
    const int32_t *c = ball.triangles + 3 * t;
    double middle[3];
    for (int k = 0; k < 3; k++) {
      middle[k] = ball.positions[3 * c[0] + k] + ball.positions[3 * c[1] + k] + ball.positions[3 * c[2] + k];
    }
    orb_normalize(middle);
    if (keep(middle)) {
      p += sprintf(p, "f %d %d %d\n", c[0] + 1, c[1] + 1, c[2] + 1);
    }
  }
  shape_free(ctx, &ball);
  return text;
}

static void cut_and_fill(int levels, int (*keep)(const double *), orb_mesh *mesh) {
  char *text = cut_ball(levels, keep);
  assert_int_equal(read_repaired(text, ORB_REPAIR_FILL_HOLES, mesh), ORB_OK);
  assert_int_equal(shape_repaired(mesh, "fill_holes"), 1);
  free(text);
}

static int beside_cap(const double *p) {
  return p[2] < cos(0.7);
}

static int beside_band(const double *p) { /* an eye mask of a hole: long, bent, and with corners */
  return !(p[0] > 0.2 && fabs(p[2]) < 0.35);
}

/* The repair closes a ball that lacks a part with nearly that part: every point of the filling is less than a tenth as
 * far from the ball as the flat disc in a cap's rim is. Its triangles grow from the rim inwards, where a polygon's
 * diagonals cross the whole hole. */
static void test_fair_fill(void **state) {
  (void)state;
  const double flat = 1 - cos(0.7), across = 2 * sin(0.7);
  for (int band = 0; band < 2; band++) {
    orb_mesh mesh;
    cut_and_fill(5, band ? beside_band : beside_cap, &mesh);
    for (int32_t v = 0; v < mesh.vertex_count; v++) {
      assert_true(fabs(orb_length(mesh.positions + 3 * v) - 1) < 0.1 * flat);
    }
    for (int32_t h = 0; h < 3 * mesh.triangle_count; h++) {
      const double *p = mesh.positions + 3 * mesh.triangles[h];
      const double *q = mesh.positions + 3 * mesh.triangles[h % 3 == 2 ? h - 2 : h + 1];
      assert_true(sqrt(orb_distance2(p, q)) < 0.25 * across);
    }
    orb_mesh_free(ctx, &mesh);
  }
}

/* Every allocation fails once; the repair reports it and leaks nothing. */
static void test_fair_fill_without_memory(void **state) {
  (void)state;
  char *text = cut_ball(5, beside_cap);
  int failures = 0;
  for (int64_t after = 0, done = 0; !done; after++) {
    int64_t left = INT64_MAX;
    orb_context *failing = remesh_failing_context(&left);
    orb_mesh mesh;
    assert_int_equal(orb_mesh_read(failing, (const unsigned char *)text, strlen(text), ORB_FORMAT_OBJ, &mesh, NULL),
                     ORB_OK);
    left = after;
    orb_status status = orb_mesh_repair(failing, &mesh, ORB_REPAIR_FILL_HOLES);
    done = status == ORB_OK;
    assert_true(done || status == ORB_E_NO_MEMORY);
    failures += !done;
    left = INT64_MAX;
    orb_mesh_free(failing, &mesh);
    orb_context_destroy(failing); /* asserts that all was freed */
  }
  assert_true(failures > 50);
  free(text);
}

/* A tube of length 1 whose ends have many edges: each end gets a dome, between the flat cap and the half ball. The
 * domes have O(edges) triangles, so holes do not exhaust the limit of a file. */
static void test_fair_fill_of_tube(void **state) {
  (void)state;
  const int n = 1000;
  char *text = malloc(300 * (size_t)n), *p = text;
  assert_non_null(text);
  for (int i = 0; i < 4 * n; i++) { /* rings near the ends, so that the faces there are not needles */
    const double a = 2 * M_PI * (i % n) / n, z[4] = {0, 0.01, 0.99, 1};
    p += sprintf(p, "v %.17g %.17g %g\n", cos(a), sin(a), z[i / n]);
  }
  for (int i = 0; i < 3 * n; i++) {
    int j = i / n * n + (i + 1) % n;
    p += sprintf(p, "f %d %d %d %d\n", i + 1, j + 1, n + j + 1, n + i + 1);
  }
  orb_mesh mesh;
  orb_extent extent;
  assert_int_equal(read_repaired(text, ORB_REPAIR_FILL_HOLES, &mesh), ORB_OK);
  assert_int_equal(shape_repaired(&mesh, "fill_holes"), 2);
  assert_true(mesh.triangle_count < 6 * n + 2 * 16 * n);
  orb_mesh_extent(&mesh, &extent);
  assert_true(extent.volume > M_PI + 0.5 && extent.volume < M_PI * (1 + 4.0 / 3));
  orb_mesh_free(ctx, &mesh);
  free(text);
}

/* A concave polygon: an L of area 3, extruded by nothing: the areas of its triangles must add up to its own. */
static void test_concave_polygon(void **state) {
  (void)state;
  const char *text = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4 5 6\n";
  orb_mesh mesh;
  orb_extent extent;
  assert_int_equal(orb_mesh_read(ctx, (const unsigned char *)text, strlen(text), ORB_FORMAT_AUTO, &mesh, NULL), ORB_OK);
  assert_int_equal(mesh.triangle_count, 4);
  orb_mesh_extent(&mesh, &extent);
  assert_true(fabs(extent.area - 3) < 1e-15);
  orb_mesh_free(ctx, &mesh);
}

static void test_copy(void **state) {
  (void)state;
  orb_mesh mesh, copy;
  assert_int_equal(read_repaired(TETRA_V "vn 0 0 1\nvt 1 1\nusemtl a\nf 1/1/1 3/1/1 2/1/1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
                                 ORB_REPAIR_SAFE, &mesh),
                   ORB_OK);
  assert_int_equal(orb_mesh_copy(ctx, &mesh, &copy), ORB_OK);
  assert_memory_equal(copy.positions, mesh.positions, 12 * sizeof(double));
  assert_memory_equal(copy.normals, mesh.normals, 36 * sizeof(float));
  assert_ptr_not_equal(copy.materials, mesh.materials);
  orb_mesh_free(ctx, &mesh);
  orb_mesh_free(ctx, &copy);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_safe),
                                     cmocka_unit_test(test_welding_of_cubes),
                                     cmocka_unit_test(test_refusals),
                                     cmocka_unit_test(test_parts),
                                     cmocka_unit_test(test_part_of_piece),
                                     cmocka_unit_test(test_torus),
                                     cmocka_unit_test(test_fill),
                                     cmocka_unit_test(test_fair_fill),
                                     cmocka_unit_test(test_fair_fill_of_tube),
                                     cmocka_unit_test(test_fair_fill_without_memory),
                                     cmocka_unit_test(test_concave_polygon),
                                     cmocka_unit_test(test_copy)};
  return cmocka_run_group_tests(tests, context_one_thread, context_end);
}
