/* The adaptive method: compares its proved bound with independent distances; landmarks, limits, memory and threads. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "numeric/vec3.h"
#include "support_remesh.h"

static void run(orb_context *ctx, const orb_aligned_shape *shapes, int count, int landmarks, double tolerance,
                int64_t most, orb_supermesh *out) {
  orb_remesh_options options;
  orb_remesh_defaults(&options);
  assert_int_equal(options.method, ORB_REMESH_ADAPTIVE);
  options.tolerance = tolerance;
  options.max_triangles = most;
  orb_status status = orb_remesh(ctx, shapes, count, landmarks, &options, out);
  if (status != ORB_OK) {
    print_message("%s: %s\n", orb_status_name(status), orb_context_error(ctx)->detail);
  }
  assert_int_equal(status, ORB_OK);
}

static double *positions_of(const orb_supermesh *m, const orb_aligned_shape *shape, int s) {
  double *out = malloc(3 * (size_t)m->vertex_count * sizeof *out);
  for (int32_t v = 0; v < m->vertex_count; v++) {
    orb_place_position(&shape->mesh, &m->places[(size_t)s * (size_t)m->vertex_count + (size_t)v], out + 3 * v);
  }
  return out;
}

/* The largest distance of sample points of one surface (corners, midpoints of edges and faces) from the other. */
static double farthest(orb_context *ctx, const double *from, const int32_t *triangles, int32_t count, const double *to,
                       const int32_t *to_triangles, int32_t to_count) {
  static const double weight[7][3] = {
      {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {.5, .5, 0}, {0, .5, .5}, {.5, 0, .5}, {1. / 3, 1. / 3, 1. / 3}};
  orb_nearest *tree;
  assert_int_equal(orb_nearest_create(ctx, to, to_triangles, to_count, &tree), ORB_OK);
  double most = 0;
  for (int32_t t = 0; t < count; t++) {
    for (int i = 0; i < 7; i++) {
      double p[3] = {0, 0, 0};
      for (int k = 0; k < 3; k++) {
        for (int j = 0; j < 3; j++) {
          p[j] += weight[i][k] * from[3 * triangles[3 * t + k] + j];
        }
      }
      orb_place place;
      most = fmax(most, orb_nearest_query(tree, p, INFINITY, &place));
    }
  }
  orb_nearest_destroy(ctx, tree);
  return sqrt(most);
}

/* Sampled distances in both directions never exceed the proved bound, and the bound never exceeds the tolerance. */
static void assert_within(orb_context *ctx, const orb_supermesh *m, const orb_aligned_shape *shapes, int count,
                          double tolerance) {
  for (int s = 0; s < count; s++) {
    const orb_mesh *mesh = &shapes[s].mesh;
    double *p = positions_of(m, &shapes[s], s);
    double there =
        farthest(ctx, mesh->positions, mesh->triangles, mesh->triangle_count, p, m->triangles, m->triangle_count);
    double back =
        farthest(ctx, p, m->triangles, m->triangle_count, mesh->positions, mesh->triangles, mesh->triangle_count);
    assert_true(there <= m->error_bound[s] && back <= m->error_bound[s]);
    assert_true(m->error_bound[s] <= tolerance * sphere_diagonal(&shapes[s]) * (1 + 1e-9));
    free(p);
  }
}

static void check(const orb_aligned_shape *shapes, int count, orb_context *ctx, double tolerance) {
  orb_supermesh m;
  run(ctx, shapes, count, 0, tolerance, 0, &m);
  sphere_assert_valid(&m, shapes, count);
  assert_within(ctx, &m, shapes, count, tolerance);
  orb_supermesh_free(ctx, &m);
}

static void check_pair(sphere_kind a, int a_size, unsigned a_seed, sphere_kind b, int b_size, unsigned b_seed,
                       double jitter, double tolerance) {
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[2];
  sphere_shape(ctx, a, a_size, jitter, a_seed, &shapes[0]);
  sphere_shape(ctx, b, b_size, jitter, b_seed, &shapes[1]);
  check(shapes, 2, ctx, tolerance);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
}

static void the_bound_holds(void **state) {
  (void)state;
  check_pair(SPHERE_ICO, 4, 1, SPHERE_OCTA, 4, 2, 0.2, 0.001);
  check_pair(SPHERE_ICO, 3, 1, SPHERE_UV, 24, 2, 0, 0.003);
  check_pair(SPHERE_TETRA, 0, 0, SPHERE_ICO, 3, 5, 0, 0.002);
  check_pair(SPHERE_TETRA, 0, 0, SPHERE_TETRA, 0, 3, 0, 0.001);
}

static void coincidences_are_handled(void **state) {
  (void)state;
  check_pair(SPHERE_UV, 24, 0, SPHERE_UV, 24, 0, 0, 0.002);   /* the same mesh twice */
  check_pair(SPHERE_OCTA, 2, 0, SPHERE_OCTA, 4, 0, 0, 0.002); /* every vertex of one on the other's edges */
  check_pair(SPHERE_OCTA, 3, 0, SPHERE_UV, 16, 0, 0, 0.002);  /* poles and meridians in common */
  check_pair(SPHERE_TETRA, 0, 0, SPHERE_TETRA, 0, 0, 0, 0.001);
}

/* The finer shape's detail survives beside a shape of 20 triangles. */
static void unlike_densities(void **state) {
  (void)state;
  check_pair(SPHERE_ICO, 0, 0, SPHERE_ICO, 4, 3, 0.2, 0.001);
}

/* A thousand triangles against forty thousand: the coarse shape keeps its bound, and so does the fine one. */
static void far_unlike_densities(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[2];
  sphere_shape(ctx, SPHERE_ICO, 3, 0.2, 1, &shapes[0]);
  sphere_shape(ctx, SPHERE_UV, 100, 0, 2, &shapes[1]);
  assert_in_range(shapes[0].mesh.triangle_count, 1000, 1500);
  assert_in_range(shapes[1].mesh.triangle_count, 35000, 45000);
  check(shapes, 2, ctx, 0.001);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
}

/* Normals of the vertices of a mesh: the sums of the cross products around them. */
static double *normals_of(const orb_mesh *mesh) {
  double *out = calloc(3 * (size_t)mesh->vertex_count, sizeof *out);
  for (int32_t t = 0; t < mesh->triangle_count; t++) {
    const int32_t *c = mesh->triangles + 3 * t;
    double u[3], v[3], n[3];
    orb_sub(mesh->positions + 3 * c[1], mesh->positions + 3 * c[0], u);
    orb_sub(mesh->positions + 3 * c[2], mesh->positions + 3 * c[0], v);
    orb_cross(u, v, n);
    for (int k = 0; k < 9; k++) {
      out[3 * c[k / 3] + k % 3] += n[k % 3];
    }
  }
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    (void)orb_normalize(out + 3 * v);
  }
  return out;
}

/* How many triangles of the supermesh face away from the shape's normals at their corners. */
static int inverted_on(const orb_supermesh *m, const orb_aligned_shape *shape, int s) {
  double *positions = positions_of(m, shape, s), *normals = normals_of(&shape->mesh);
  int inverted = 0;
  for (int32_t t = 0; t < m->triangle_count; t++) {
    const int32_t *c = m->triangles + 3 * t;
    double u[3], v[3], n[3], ground[3] = {0, 0, 0};
    orb_sub(positions + 3 * c[1], positions + 3 * c[0], u);
    orb_sub(positions + 3 * c[2], positions + 3 * c[0], v);
    orb_cross(u, v, n);
    for (int k = 0; k < 3; k++) {
      const orb_place *place = &m->places[s * m->vertex_count + c[k]];
      for (int i = 0; i < 9; i++) {
        ground[i % 3] += place->at[i / 3] * normals[3 * shape->mesh.triangles[3 * place->triangle + i / 3] + i % 3];
      }
    }
    inverted += orb_dot(n, ground) <= 0;
  }
  free(positions);
  free(normals);
  return inverted;
}

/* Rotates each point of a ball in space around the axis by `most` times its height and keeps the sphere's points: a map
 * to another ball then shears. */
static void shear(const orb_aligned_shape *shape, double most) {
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    const double *at = shape->points + 3 * v;
    double turn = most * at[2], *p = shape->mesh.positions + 3 * v;
    double size = sqrt(orb_dot(p, p)), x = at[0], y = at[1];
    p[0] = size * (cos(turn) * x - sin(turn) * y);
    p[1] = size * (sin(turn) * x + cos(turn) * y);
    p[2] = size * at[2];
  }
}

/* No triangle of the supermesh may be inverted. */
static void sheared_maps_invert_no_triangle(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[2];
  sphere_shape(ctx, SPHERE_ICO, 4, 0.2, 1, &shapes[0]);
  sphere_shape(ctx, SPHERE_OCTA, 4, 0.2, 2, &shapes[1]);
  shear(&shapes[1], 2.5);
  orb_supermesh m;
  run(ctx, shapes, 2, 0, 0.002, 0, &m);
  sphere_assert_valid(&m, shapes, 2);
  assert_within(ctx, &m, shapes, 2, 0.002);
  for (int s = 0; s < 2; s++) {
    assert_int_equal(inverted_on(&m, &shapes[s], s), 0);
  }
  orb_supermesh_free(ctx, &m);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
}

/* Rough shapes under a map that shears: triangles are inverted wherever they are not small. Repairing these must keep
 * the tolerance. */
static void sheared_maps_keep_the_tolerance(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 6; seed++) {
    orb_context *ctx = remesh_context(2);
    orb_aligned_shape shapes[2];
    sphere_shape(ctx, SPHERE_ICO, 3, 0.2, seed, &shapes[0]);
    sphere_shape(ctx, SPHERE_OCTA, 3, 0.2, seed + 10, &shapes[1]);
    shear(&shapes[1], 4);
    unsigned random = seed;
    for (int s = 0; s < 2; s++) {
      for (int32_t i = 0; i < 3 * shapes[s].mesh.vertex_count; i += 3) {
        random = random * 1664525u + 1013904223u;
        double size = 0.8 + 0.4 * (random >> 16) / 65536.0;
        for (int k = 0; k < 3; k++) {
          shapes[s].mesh.positions[i + k] *= size;
        }
      }
    }
    check(shapes, 2, ctx, 0.01);
    sphere_shape_free(ctx, &shapes[0]);
    sphere_shape_free(ctx, &shapes[1]);
    orb_context_destroy(ctx);
  }
}

/* Moves the first ring north of the equator to height `flat` and spreads the others over the rest. */
static void flatten_belt(orb_aligned_shape *shape, double flat) {
  double ring = 1;
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    double z = shape->points[3 * v + 2];
    ring = z > 1e-9 && z < ring ? z : ring;
  }
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    double *p = shape->points + 3 * v, z = p[2], round = hypot(p[0], p[1]);
    if (z > 1e-9 && round > 1e-9) {
      double to = z < ring * (1 + 1e-9) ? flat : flat + (1 - flat) * (z - ring) / (1 - ring);
      double scale = sqrt(1 - to * to) / round;
      p[0] *= scale;
      p[1] *= scale;
      p[2] = to;
    }
  }
}

/* A map that flattens a belt of large triangles to almost nothing on the sphere: splitting edges where they cross the
 * belt would never end. */
static void flattened_belts_do_not_creep(void **state) {
  (void)state;
  static const double flat[] = {1e-3, 1e-5, 1e-7, 1e-9};
  for (int i = 0; i < 4; i++) {
    orb_context *ctx = remesh_context(2);
    orb_aligned_shape shapes[2];
    sphere_shape(ctx, SPHERE_ICO, 4, 0.2, 1, &shapes[0]);
    sphere_shape(ctx, SPHERE_UV, 24, 0, 2, &shapes[1]);
    flatten_belt(&shapes[1], flat[i]);
    check(shapes, 2, ctx, 0.001);
    sphere_shape_free(ctx, &shapes[0]);
    sphere_shape_free(ctx, &shapes[1]);
    orb_context_destroy(ctx);
  }
}

/* Twists a ball around an axis in space; the sphere's points stay. */
static void wind(const orb_aligned_shape *shape, int axis, double most) {
  int x = (axis + 1) % 3, y = (axis + 2) % 3;
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    double *p = shape->mesh.positions + 3 * v, turn = most * p[axis] / sqrt(orb_dot(p, p)), px = p[x], py = p[y];
    p[x] = cos(turn) * px - sin(turn) * py;
    p[y] = sin(turn) * px + cos(turn) * py;
  }
}

/* A map that winds one surface around the other, as landmarks in random order do: nearly every triangle is a needle on
 * one of them. The tolerance still holds. */
static void wound_maps_keep_the_tolerance(void **state) {
  (void)state;
  static const double tolerance[] = {0.02, 0.002};
  for (int i = 0; i < 2; i++) {
    orb_context *ctx = remesh_context(2);
    orb_aligned_shape shapes[2];
    sphere_shape(ctx, SPHERE_ICO, 3, 0.2, 1, &shapes[0]);
    sphere_shape(ctx, SPHERE_OCTA, 3, 0.2, 2, &shapes[1]);
    for (int axis = 0; axis < 3; axis++) {
      wind(&shapes[1], axis, 5);
    }
    check(shapes, 2, ctx, tolerance[i]);
    sphere_shape_free(ctx, &shapes[0]);
    sphere_shape_free(ctx, &shapes[1]);
    orb_context_destroy(ctx);
  }
}

/* Winds the sphere's points around the axis ring by ring, `turns` times from pole to pole; the surface stays. */
static void wind_points(const orb_aligned_shape *shape, double turns) {
  for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
    double *p = shape->points + 3 * v, turn = turns * acos(fmax(-1, fmin(1, p[2]))) * 2, x = p[0], y = p[1];
    p[0] = cos(turn) * x - sin(turn) * y;
    p[1] = sin(turn) * x + cos(turn) * y;
  }
}

/* The map winds so much that the overlay has more than twenty times the triangles of both shapes. The shapes are
 * reduced before the overlay, and the bound still holds for the original shapes. */
static void huge_overlays_are_not_needed(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[2];
  orb_certificate certificate;
  sphere_shape(ctx, SPHERE_UV, 97, 0, 0, &shapes[0]);
  sphere_shape(ctx, SPHERE_UV, 100, 0, 0, &shapes[1]);
  wind_points(&shapes[0], 3);
  wind_points(&shapes[1], -3);
  for (int s = 0; s < 2; s++) {
    const orb_mesh *mesh = &shapes[s].mesh;
    assert_int_equal(
        orb_certify(ctx, shapes[s].points, mesh->vertex_count, mesh->triangles, mesh->triangle_count, &certificate),
        ORB_OK);
    assert_true(certificate.valid);
  }
  orb_supermesh overlay;
  assert_int_equal(remesh_by(ctx, ORB_REMESH_OVERLAY, shapes, 2, &overlay), ORB_OK);
  assert_true(overlay.triangle_count > 20 * (shapes[0].mesh.triangle_count + shapes[1].mesh.triangle_count));
  orb_supermesh_free(ctx, &overlay);
  check(shapes, 2, ctx, 0.02);
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
}

static void four_shapes(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(2);
  orb_aligned_shape shapes[4];
  for (int s = 0; s < 4; s++) {
    sphere_shape(ctx, s & 1 ? SPHERE_OCTA : SPHERE_ICO, 3, 0.2, (unsigned)s + 1, &shapes[s]);
  }
  check(shapes, 4, ctx, 0.004);
  for (int s = 0; s < 4; s++) {
    sphere_shape_free(ctx, &shapes[s]);
  }
  orb_context_destroy(ctx);
}

/* Gives both shapes the ends of the axes as landmarks, which are vertices of both triangulations. */
static void axis_landmarks(orb_context *ctx, orb_aligned_shape *shape) {
  static const double axis[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  shape->landmark_vertices = ORB_NEW(ctx, int32_t, 6);
  for (int i = 0; i < 6; i++) {
    for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
      if (memcmp(shape->points + 3 * v, axis[i], sizeof axis[i]) == 0) {
        shape->landmark_vertices[i] = v;
      }
    }
  }
}

static void landmarks_and_limits_are_kept(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(1);
  orb_aligned_shape shapes[2];
  for (int s = 0; s < 2; s++) {
    sphere_shape(ctx, SPHERE_OCTA, 4, 0, 0, &shapes[s]);
    axis_landmarks(ctx, &shapes[s]);
  }
  for (int32_t v = 0; v < shapes[1].mesh.vertex_count; v++) {
    shapes[1].mesh.positions[3 * v] *= 2;
  }
  const int64_t limits[3] = {0, 100, 20};
  double error = 0;
  for (int i = 0; i < 3; i++) {
    orb_supermesh m;
    run(ctx, shapes, 2, 6, 0.01, limits[i], &m);
    sphere_assert_valid(&m, shapes, 2);
    assert_true(limits[i] == 0 || m.triangle_count <= limits[i]);
    assert_within(ctx, &m, shapes, 2, limits[i] ? 1 : 0.01);
    assert_true(m.error_bound[0] >= error);
    error = m.error_bound[0];
    for (int k = 0; k < 6; k++) {
      assert_true(m.landmark_vertices[k] >= 0);
      for (int s = 0; s < 2; s++) {
        double p[3];
        orb_place_position(&shapes[s].mesh, &m.places[s * m.vertex_count + m.landmark_vertices[k]], p);
        assert_memory_equal(p, shapes[s].mesh.positions + 3 * shapes[s].landmark_vertices[k], sizeof p);
      }
    }
    orb_supermesh_free(ctx, &m);
  }
  sphere_shape_free(ctx, &shapes[0]);
  sphere_shape_free(ctx, &shapes[1]);
  orb_context_destroy(ctx);
}

/* A cube of n × n quads a side, from −1 to 1; its points are its directions. */
static void cube_shape(orb_context *ctx, int n, orb_aligned_shape *out) {
  int32_t *number = malloc((size_t)(n + 1) * (size_t)(n + 1) * (size_t)(n + 1) * sizeof *number);
  memset(out, 0, sizeof *out);
  out->mesh.positions = ORB_NEW(ctx, double, 3 * (6 * n * n + 2));
  out->points = ORB_NEW(ctx, double, 3 * (6 * n * n + 2));
  out->mesh.triangles = ORB_NEW(ctx, int32_t, 36 * n * n);
  for (int i = 0; i < (n + 1) * (n + 1) * (n + 1); i++) {
    int at[3] = {i % (n + 1), i / (n + 1) % (n + 1), i / (n + 1) / (n + 1)};
    if (at[0] % n && at[1] % n && at[2] % n) {
      continue; /* inside */
    }
    double *p = out->mesh.positions + 3 * out->mesh.vertex_count, *unit = out->points + 3 * out->mesh.vertex_count;
    for (int k = 0; k < 3; k++) {
      unit[k] = p[k] = 2.0 * at[k] / n - 1;
    }
    (void)orb_normalize(unit);
    number[i] = out->mesh.vertex_count++;
  }
  int step[3] = {1, n + 1, (n + 1) * (n + 1)};
  for (int q = 0; q < 6 * n * n; q++) {
    int axis = q % 3, u = step[(axis + 1) % 3], v = step[(axis + 2) % 3];
    int corner = q / 3 % 2 * n * step[axis] + q / 6 % n * u + q / 6 / n * v;
    int32_t four[4] = {number[corner], number[corner + u], number[corner + u + v], number[corner + v]};
    for (int t = 0; t < 2; t++) {
      int32_t *c = out->mesh.triangles + 3 * out->mesh.triangle_count++;
      c[0] = four[0];
      c[1] = q / 3 % 2 ? four[1 + t] : four[2 + t];
      c[2] = q / 3 % 2 ? four[2 + t] : four[1 + t];
    }
  }
  free(number);
}

static double distance_to(const orb_nearest *tree, const double p[3]) {
  orb_place place;
  return sqrt(orb_nearest_query(tree, p, INFINITY, &place));
}

/* How much of a surface faces away from all six sides of a cube by more than ten degrees. */
static double slanting_area(const orb_supermesh *m, const double *p) {
  double area = 0;
  for (int32_t t = 0; t < m->triangle_count; t++) {
    double u[3], v[3], n[3];
    orb_sub(p + 3 * m->triangles[3 * t + 1], p + 3 * m->triangles[3 * t], u);
    orb_sub(p + 3 * m->triangles[3 * t + 2], p + 3 * m->triangles[3 * t], v);
    orb_cross(u, v, n);
    double most = fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2])));
    area += most < cos(M_PI / 18) * orb_length(n) ? 0.5 * orb_length(n) : 0;
  }
  return area;
}

/* A shape that is remeshed with another one within a tolerance, and its surface in the supermesh. */
typedef struct kept {
  orb_context *ctx;
  orb_aligned_shape shapes[2];
  orb_supermesh mesh;
  double *positions;
  orb_nearest *tree;
} kept;

static void keep(kept *k, double tolerance) {
  run(k->ctx, k->shapes, 2, 0, tolerance, 0, &k->mesh);
  sphere_assert_valid(&k->mesh, k->shapes, 2);
  assert_within(k->ctx, &k->mesh, k->shapes, 2, tolerance);
  k->positions = positions_of(&k->mesh, &k->shapes[0], 0);
  assert_int_equal(orb_nearest_create(k->ctx, k->positions, k->mesh.triangles, k->mesh.triangle_count, &k->tree),
                   ORB_OK);
}

static void kept_free(kept *k) {
  free(k->positions);
  orb_nearest_destroy(k->ctx, k->tree);
  orb_supermesh_free(k->ctx, &k->mesh);
  sphere_shape_free(k->ctx, &k->shapes[0]);
  sphere_shape_free(k->ctx, &k->shapes[1]);
  orb_context_destroy(k->ctx);
}

/* A cube remeshed with a ball keeps its edges and corners: each of their points is within the tolerance h, and the
 * slanted area is at most that of chamfers of depth h: 2h wide along 12 edges of length 2, doubled for corners and
 * slivers. */
static void sharp_edges_survive(void **state) {
  (void)state;
  static const double tolerance = 0.002;
  double h = tolerance * 2 * sqrt(3);
  kept k = {.ctx = remesh_context(2)};
  cube_shape(k.ctx, 16, &k.shapes[0]);
  sphere_shape(k.ctx, SPHERE_ICO, 4, 0.2, 3, &k.shapes[1]);
  keep(&k, tolerance);
  for (int edge = 0; edge < 12; edge++) {
    for (int i = 0; i <= 50; i++) {
      double q[3];
      q[edge % 3] = i / 25.0 - 1;
      q[(edge + 1) % 3] = edge / 3 % 2 ? 1 : -1;
      q[(edge + 2) % 3] = edge / 6 ? 1 : -1;
      assert_true(distance_to(k.tree, q) <= h);
    }
  }
  assert_true(slanting_area(&k.mesh, k.positions) <= 2 * 12 * 2 * 2 * h);
  kept_free(&k);
}

/* A spike of one vertex, four times as long as its ball is thick and a thirtieth as wide as it is long, opposite a
 * smooth part of the other shape: its tip and its flanks stay. */
static void thin_limbs_survive(void **state) {
  (void)state;
  static const double tolerance = 0.002;
  enum { TIP = 700 };
  kept k = {.ctx = remesh_context(2)};
  sphere_shape(k.ctx, SPHERE_ICO, 4, 0, 0, &k.shapes[0]);
  sphere_shape(k.ctx, SPHERE_UV, 24, 0, 2, &k.shapes[1]);
  const orb_mesh *mesh = &k.shapes[0].mesh;
  double *tip = mesh->positions + 3 * TIP, least = INFINITY;
  for (int c = 0; c < 3; c++) {
    tip[c] = 9 * k.shapes[0].points[3 * TIP + c];
  }
  double h = tolerance * sphere_diagonal(&k.shapes[0]);
  keep(&k, tolerance);
  for (int32_t v = 0; v < k.mesh.vertex_count; v++) {
    least = fmin(least, sqrt(orb_distance2(k.positions + 3 * v, tip)));
  }
  assert_true(least <= h);
  for (int32_t e = 0; e < 3 * mesh->triangle_count; e++) { /* edges from the tip, all the way down */
    const double *foot = mesh->positions + 3 * mesh->triangles[orb_next(e)];
    for (int i = 0; i <= 20 && mesh->triangles[e] == TIP; i++) {
      double q[3];
      for (int c = 0; c < 3; c++) {
        q[c] = tip[c] + i / 20.0 * (foot[c] - tip[c]);
      }
      assert_true(distance_to(k.tree, q) <= h);
    }
  }
  kept_free(&k);
}

static void bad_options_are_named(void **state) {
  (void)state;
  orb_context *ctx = remesh_context(1);
  orb_aligned_shape shape;
  sphere_shape(ctx, SPHERE_OCTA, 1, 0, 0, &shape);
  orb_supermesh m;
  orb_remesh_options options;
  orb_remesh_defaults(&options);
  options.tolerance = NAN;
  assert_int_equal(orb_remesh(ctx, &shape, 1, 0, &options, &m), ORB_E_BAD_OPTION);
  orb_remesh_defaults(&options);
  options.max_triangles = 3;
  assert_int_equal(orb_remesh(ctx, &shape, 1, 0, &options, &m), ORB_E_BAD_OPTION);
  assert_int_equal(orb_remesh(ctx, &shape, 0, 0, NULL, &m), ORB_E_BAD_OPTION);
  sphere_shape_free(ctx, &shape);
  orb_context_destroy(ctx);
}

static void threads_do_not_matter(void **state) {
  (void)state;
  remesh_assert_threads_do_not_matter(ORB_REMESH_ADAPTIVE);
}

static void failing_allocations(void **state) {
  (void)state;
  remesh_assert_fails_cleanly(ORB_REMESH_ADAPTIVE);
  remesh_assert_fails_cleanly(ORB_REMESH_SUBDIVISION);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_bound_holds),
      cmocka_unit_test(coincidences_are_handled),
      cmocka_unit_test(unlike_densities),
      cmocka_unit_test(far_unlike_densities),
      cmocka_unit_test(sheared_maps_invert_no_triangle),
      cmocka_unit_test(sheared_maps_keep_the_tolerance),
      cmocka_unit_test(flattened_belts_do_not_creep),
      cmocka_unit_test(wound_maps_keep_the_tolerance),
      cmocka_unit_test(huge_overlays_are_not_needed),
      cmocka_unit_test(four_shapes),
      cmocka_unit_test(landmarks_and_limits_are_kept),
      cmocka_unit_test(sharp_edges_survive),
      cmocka_unit_test(thin_limbs_survive),
      cmocka_unit_test(bad_options_are_named),
      cmocka_unit_test(threads_do_not_matter),
      cmocka_unit_test(failing_allocations),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
