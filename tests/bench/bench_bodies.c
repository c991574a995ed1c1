/* Generates bodies of any size: geodesic spheres with slightly jittered vertices whose radius swells into limbs. The
 * bodies are star-shaped, so the directions of their vertices are already a valid embedding. */
#include <math.h>
#include <string.h>

#include "bench.h"

enum { LIMBS = 9 };

static double noise(uint64_t *state) {
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return (double)(*state >> 11) / 9007199254740992.0 - 0.5;
}

static void normalize(double p[3]) {
  double length = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
  for (int k = 0; k < 3; k++) {
    p[k] /= length;
  }
}

/* The radius in direction p. All bodies have their limbs in the same directions; the seed sets the lengths. */
static double radius(const double p[3], uint64_t seed) {
  double r = 1;
  uint64_t same = 12345, own = 99 * seed + 7;
  for (int i = 0; i < LIMBS; i++) {
    double c[3] = {noise(&same), noise(&same), noise(&same)}, length = 0.9 + noise(&own);
    normalize(c);
    double distance2 = 0;
    for (int k = 0; k < 3; k++) {
      distance2 += (p[k] - c[k]) * (p[k] - c[k]);
    }
    r += length * exp(-18 * distance2);
  }
  return r + 0.02 * sin(13 * p[0] + 1.7 * (double)seed) * sin(11 * p[1]) * sin(17 * p[2]);
}

/* The first vertex of a row. Each face of the octahedron is divided into n rows; the vertices are numbered row by row
 * from the north pole down, and a row has constant height. */
static int32_t ring_start(int32_t n, int32_t row) {
  if (row == 0) {
    return 0;
  }
  int32_t upper = row <= n ? row : n;
  int32_t count = 1 + 2 * upper * (upper - 1); /* rows 0 to upper − 1 */
  for (int32_t r = n; r < row; r++) {
    count += 4 * (2 * n - r);
  }
  return count;
}

static int32_t ring_size(int32_t n, int32_t row) {
  int32_t size = row <= n ? row : 2 * n - row;
  return size > 0 ? 4 * size : 1;
}

static void place_row(int32_t n, int32_t row, uint64_t *state, double *p) {
  int32_t size = ring_size(n, row);
  double pi = 3.14159265358979323846, spacing = pi / (2 * n);
  double height =
      row <= n ? 1 - (double)row * row / ((double)n * n) : (double)(2 * n - row) * (2 * n - row) / ((double)n * n) - 1;
  for (int32_t i = 0; i < size; i++) {
    double turn = 2 * pi * i / size, flat = sqrt(fmax(0, 1 - height * height));
    double q[3] = {flat * cos(turn), flat * sin(turn), height};
    for (int k = 0; k < 3; k++) {
      p[3 * i + k] = q[k] + 0.2 * spacing * noise(state);
    }
    normalize(p + 3 * i);
  }
}

/* The triangles between two rows: each quarter has one more vertex on the wider row. */
static int32_t *join_rows(int32_t n, int32_t row, int32_t *out) {
  int32_t a = ring_start(n, row), b = ring_start(n, row + 1);
  int32_t sizes[2] = {ring_size(n, row), ring_size(n, row + 1)};
  int down = row < n; /* the lower row is the wider one */
  int32_t wide = down ? row + 1 : 2 * n - row, narrow = wide - 1;
  int32_t w = down ? b : a, s = down ? a : b, w_size = down ? sizes[1] : sizes[0], s_size = down ? sizes[0] : sizes[1];
  for (int32_t quarter = 0; quarter < 4; quarter++) {
    for (int32_t i = 0; i < wide; i++) {
      int32_t w0 = w + (quarter * wide + i) % w_size, w1 = w + (quarter * wide + i + 1) % w_size;
      int32_t s0 = s + (quarter * narrow + i) % s_size, s1 = s + (quarter * narrow + i + 1) % s_size;
      int32_t triangles[2][3] = {{s0, w0, w1}, {s0, w1, s1}};
      for (int k = 0; k < (i + 1 < wide ? 2 : 1); k++) {
        out[0] = triangles[k][0];
        out[1] = triangles[k][down ? 1 : 2];
        out[2] = triangles[k][down ? 2 : 1];
        out += 3;
      }
    }
  }
  return out;
}

int bench_body(orb_context *ctx, int32_t triangles, uint64_t seed, orb_aligned_shape *out) {
  int32_t n = (int32_t)ceil(sqrt(triangles / 8.0));
  int32_t vertices = 4 * n * n + 2;
  uint64_t state = 77 * seed + 1;
  memset(out, 0, sizeof *out);
  orb_mesh *mesh = &out->mesh;
  mesh->vertex_count = vertices;
  mesh->triangle_count = 8 * n * n;
  mesh->positions = orb_alloc(ctx, 3 * (size_t)vertices, sizeof(double));
  mesh->triangles = orb_alloc(ctx, 24 * (size_t)n * (size_t)n, sizeof(int32_t));
  out->points = orb_alloc(ctx, 3 * (size_t)vertices, sizeof(double));
  if (!mesh->positions || !mesh->triangles || !out->points) {
    return 0;
  }
  int32_t *next = mesh->triangles;
  for (int32_t row = 0; row <= 2 * n; row++) {
    place_row(n, row, &state, out->points + 3 * (size_t)ring_start(n, row));
    next = row < 2 * n ? join_rows(n, row, next) : next;
  }
  double tilt = 0.1 + 0.37 * (double)seed, c = cos(tilt), s = sin(tilt);
  for (int32_t v = 0; v < vertices; v++) { /* otherwise the grids of two bodies would coincide */
    double *p = out->points + 3 * (size_t)v;
    double q[3] = {c * p[0] - s * p[2], p[1], s * p[0] + c * p[2]};
    double r[3] = {q[0], c * q[1] - s * q[2], s * q[1] + c * q[2]}, size;
    normalize(r);
    memcpy(p, r, sizeof r);
    size = radius(p, seed);
    for (int k = 0; k < 3; k++) {
      mesh->positions[3 * (size_t)v + (size_t)k] = size * p[k];
    }
  }
  return orb_certify(ctx, out->points, vertices, mesh->triangles, mesh->triangle_count, &out->certificate) == ORB_OK &&
         out->certificate.valid;
}
