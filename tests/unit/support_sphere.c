#include "support_sphere.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"

double sphere_uniform(uint64_t *state) {
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return (double)(*state >> 11) / 9007199254740992.0;
}

void sphere_random(uint64_t *state, double out[3]) {
  do {
    for (int k = 0; k < 3; k++) {
      out[k] = 2 * sphere_uniform(state) - 1;
    }
  } while (orb_length(out) < 0.1 || orb_length(out) > 1);
  (void)orb_normalize(out);
}

typedef struct builder {
  double *p;
  int32_t *t;
  int32_t nv, nt;
} builder;

static int32_t add_vertex(builder *b, double x, double y, double z) {
  double *p = b->p + 3 * (size_t)b->nv;
  p[0] = x;
  p[1] = y;
  p[2] = z;
  (void)orb_normalize(p);
  return b->nv++;
}

static void add_triangle(builder *b, int32_t i, int32_t j, int32_t k) {
  int32_t *t = b->t + 3 * (size_t)b->nt++;
  int reversed = orb_det(b->p + 3 * (size_t)i, b->p + 3 * (size_t)j, b->p + 3 * (size_t)k) < 0;
  t[0] = i;
  t[1] = reversed ? k : j;
  t[2] = reversed ? j : k;
}

static void add_hull(builder *b, const double (*p)[3], int n, double edge) {
  for (int i = 0; i < n; i++) {
    (void)add_vertex(b, p[i][0], p[i][1], p[i][2]);
  }
  for (int i = 0; i < n; i++) {
    for (int j = i + 1; j < n; j++) {
      for (int k = j + 1; k < n; k++) {
        if (orb_distance2(p[i], p[j]) < edge && orb_distance2(p[j], p[k]) < edge && orb_distance2(p[i], p[k]) < edge) {
          add_triangle(b, i, j, k);
        }
      }
    }
  }
}

static void split_all(builder *b) {
  int32_t old = b->nt, *t = malloc(3 * (size_t)old * sizeof *t);
  int32_t *mid = malloc(3 * (size_t)old * sizeof *mid);
  memcpy(t, b->t, 3 * (size_t)old * sizeof *t);
  b->nt = 0;
  for (int32_t h = 0; h < 3 * old; h++) {
    int32_t i = t[h], j = t[orb_next(h)];
    mid[h] = -1;
    const double *p = b->p + 3 * (size_t)i, *q = b->p + 3 * (size_t)j;
    if (i < j) {
      mid[h] = add_vertex(b, p[0] + q[0], p[1] + q[1], p[2] + q[2]);
    }
  }
  /* Finds the twin by brute force over the edges of each origin. */
  int32_t *head = malloc((size_t)b->nv * sizeof *head), *next = malloc(3 * (size_t)old * sizeof *next);
  memset(head, -1, (size_t)b->nv * sizeof *head);
  for (int32_t h = 0; h < 3 * old; h++) {
    next[h] = head[t[h]];
    head[t[h]] = h;
  }
  for (int32_t h = 0; h < 3 * old; h++) {
    for (int32_t g = head[t[orb_next(h)]]; g >= 0 && mid[h] < 0; g = next[g]) {
      if (t[orb_next(g)] == t[h]) {
        mid[h] = mid[g];
      }
    }
  }
  for (int32_t i = 0; i < old; i++) {
    for (int k = 0; k < 3; k++) {
      add_triangle(b, t[3 * i + k], mid[3 * i + k], mid[3 * i + (k + 2) % 3]);
    }
    add_triangle(b, mid[3 * i], mid[3 * i + 1], mid[3 * i + 2]);
  }
  free(t);
  free(mid);
  free(head);
  free(next);
}

static void build_uv(builder *b, int rings) {
  int columns = 2 * rings;
  (void)add_vertex(b, 0, 0, 1);
  for (int i = 1; i < rings; i++) {
    for (int j = 0; j < columns; j++) {
      double a = M_PI * i / rings, c = 2 * M_PI * j / columns;
      (void)add_vertex(b, sin(a) * cos(c), sin(a) * sin(c), cos(a));
    }
  }
  int32_t south = add_vertex(b, 0, 0, -1);
  for (int j = 0; j < columns; j++) {
    int next = (j + 1) % columns;
    add_triangle(b, 0, 1 + j, 1 + next);
    for (int i = 0; i + 2 < rings; i++) {
      int32_t r = 1 + i * columns;
      add_triangle(b, r + j, r + columns + j, r + columns + next);
      add_triangle(b, r + j, r + columns + next, r + next);
    }
    add_triangle(b, south, south - columns + j, south - columns + next);
  }
}

static void build(builder *b, sphere_kind kind, int size) {
  static const double tetra[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  static const double octa[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  if (kind == SPHERE_UV) {
    build_uv(b, size);
    return;
  }
  if (kind == SPHERE_TETRA) {
    add_hull(b, tetra, 4, 8.1);
  } else if (kind == SPHERE_OCTA) {
    add_hull(b, octa, 6, 2.1);
  } else {
    double g = 0.5 + sqrt(1.25), ico[12][3];
    for (int i = 0; i < 12; i++) {
      double u = i & 1 ? 1 : -1, v = i & 2 ? g : -g;
      ico[i][(i / 4 + 0) % 3] = 0;
      ico[i][(i / 4 + 1) % 3] = u;
      ico[i][(i / 4 + 2) % 3] = v;
    }
    add_hull(b, (const double(*)[3])ico, 12, 4.1);
  }
  for (int i = 0; i < size; i++) {
    split_all(b);
  }
}

static void rotate(builder *b, uint64_t *state) {
  double x[3], y[3], z[3], r[3];
  sphere_random(state, x);
  sphere_random(state, r);
  orb_cross(x, r, y);
  (void)orb_normalize(y);
  orb_cross(x, y, z);
  for (int32_t v = 0; v < b->nv; v++) {
    double *p = b->p + 3 * (size_t)v;
    double q[3] = {orb_dot(x, p), orb_dot(y, p), orb_dot(z, p)};
    memcpy(p, q, sizeof q);
    (void)orb_normalize(p);
  }
}

static int all_positive(const builder *b, int32_t v) {
  for (int32_t t = 0; t < b->nt; t++) {
    const int32_t *c = b->t + 3 * (size_t)t;
    if ((c[0] == v || c[1] == v || c[2] == v || v < 0) &&
        orb_orient(b->p + 3 * (size_t)c[0], b->p + 3 * (size_t)c[1], b->p + 3 * (size_t)c[2]) <= 0) {
      return 0;
    }
  }
  return 1;
}

static void shake(builder *b, double jitter, uint64_t *state) {
  double edge = sqrt(4 * M_PI / b->nt);
  double *old = malloc(3 * (size_t)b->nv * sizeof *old);
  memcpy(old, b->p, 3 * (size_t)b->nv * sizeof *old);
  for (double scale = jitter; scale > 1e-3 * jitter; scale *= 0.5) {
    for (int32_t v = 0; v < b->nv; v++) {
      double d[3];
      sphere_random(state, d);
      for (int k = 0; k < 3; k++) {
        b->p[3 * (size_t)v + (size_t)k] = old[3 * (size_t)v + (size_t)k] + scale * edge * d[k];
      }
      (void)orb_normalize(b->p + 3 * (size_t)v);
    }
    if (all_positive(b, -1)) {
      break;
    }
    memcpy(b->p, old, 3 * (size_t)b->nv * sizeof *old);
  }
  free(old);
}

static void surface(const double p[3], unsigned seed, double out[3]) {
  double phase = 0.7 * seed, radius = 1 + 0.15 * sin(5 * p[0] + phase) * cos(4 * p[1]) + 0.1 * sin(7 * p[2] - phase);
  out[0] = 3 * radius * p[0] + 0.3 * seed;
  out[1] = (1 + 0.2 * (seed % 3)) * radius * p[1];
  out[2] = radius * p[2] + 0.4 * p[0] * p[0];
}

void sphere_shape(orb_context *ctx, sphere_kind kind, int size, double jitter, unsigned seed, orb_aligned_shape *out) {
  memset(out, 0, sizeof *out);
  size_t room = kind == SPHERE_UV ? (size_t)(4 * size * size + 8) : (size_t)32 << (2 * size);
  builder b = {calloc(3 * room, sizeof(double)), calloc(3 * room, sizeof(int32_t)), 0, 0};
  uint64_t state = seed * 977u + 13;
  build(&b, kind, size);
  if (seed) {
    rotate(&b, &state);
  }
  if (jitter > 0) {
    shake(&b, jitter, &state);
  }
  assert_true(all_positive(&b, -1));
  out->mesh.vertex_count = b.nv;
  out->mesh.triangle_count = b.nt;
  out->points = ORB_NEW(ctx, double, 3 * b.nv);
  out->mesh.positions = ORB_NEW(ctx, double, 3 * b.nv);
  out->mesh.triangles = ORB_NEW(ctx, int32_t, 3 * b.nt);
  assert_true(out->points && out->mesh.positions && out->mesh.triangles);
  memcpy(out->points, b.p, 3 * (size_t)b.nv * sizeof(double));
  memcpy(out->mesh.triangles, b.t, 3 * (size_t)b.nt * sizeof(int32_t));
  for (int32_t v = 0; v < b.nv; v++) {
    surface(b.p + 3 * (size_t)v, seed, out->mesh.positions + 3 * (size_t)v);
  }
  free(b.p);
  free(b.t);
}

void sphere_shape_free(orb_context *ctx, orb_aligned_shape *shape) {
  orb_free(ctx, shape->points);
  orb_free(ctx, shape->mesh.positions);
  orb_free(ctx, shape->mesh.triangles);
  orb_free(ctx, shape->landmark_vertices);
  memset(shape, 0, sizeof *shape);
}

/* The triangle that contains p best, and p's central projection onto it. */
static void project_brute(const double *points, const int32_t *triangles, int32_t count, const double p[3],
                          int32_t *triangle, double at[3]) {
  double best = -INFINITY;
  for (int32_t t = 0; t < count; t++) {
    const double *a = points + 3 * (size_t)triangles[3 * t], *b = points + 3 * (size_t)triangles[3 * t + 1],
                 *c = points + 3 * (size_t)triangles[3 * t + 2];
    double u = orb_det(p, b, c), v = orb_det(a, p, c), w = orb_det(a, b, p), sum = u + v + w;
    double least = fmin(u, fmin(v, w));
    if (sum > 0 && least / sum > best) {
      best = least / sum;
      *triangle = t;
      at[0] = u / sum;
      at[1] = v / sum;
      at[2] = w / sum;
    }
  }
  assert_true(best > -1e-6);
}

void sphere_evaluate(const orb_aligned_shape *shape, const double p[3], double out[3]) {
  orb_place place;
  project_brute(shape->points, shape->mesh.triangles, shape->mesh.triangle_count, p, &place.triangle, place.at);
  out[0] = out[1] = out[2] = 0;
  for (int k = 0; k < 3; k++) {
    for (int j = 0; j < 3; j++) {
      out[j] += place.at[k] * shape->mesh.positions[3 * shape->mesh.triangles[3 * place.triangle + k] + j];
    }
  }
}

static void place_position(const orb_aligned_shape *shape, const orb_place *place, double out[3]) {
  out[0] = out[1] = out[2] = 0;
  for (int k = 0; k < 3; k++) {
    for (int j = 0; j < 3; j++) {
      out[j] += place->at[k] * shape->mesh.positions[3 * shape->mesh.triangles[3 * place->triangle + k] + j];
    }
  }
}

void sphere_evaluate_supermesh(const orb_supermesh *m, const orb_aligned_shape *shape, int s, const double p[3],
                               double out[3]) {
  int32_t triangle = 0;
  double at[3];
  project_brute(m->points, m->triangles, m->triangle_count, p, &triangle, at);
  out[0] = out[1] = out[2] = 0;
  for (int k = 0; k < 3; k++) {
    double q[3];
    place_position(shape, &m->places[(size_t)s * (size_t)m->vertex_count + (size_t)m->triangles[3 * triangle + k]], q);
    for (int j = 0; j < 3; j++) {
      out[j] += at[k] * q[j];
    }
  }
}

double sphere_diagonal(const orb_aligned_shape *shape) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    double low = INFINITY, high = -INFINITY;
    for (int32_t v = 0; v < shape->mesh.vertex_count; v++) {
      low = fmin(low, shape->mesh.positions[3 * v + k]);
      high = fmax(high, shape->mesh.positions[3 * v + k]);
    }
    sum += (high - low) * (high - low);
  }
  return sqrt(sum);
}

static int compare_u64(const void *a, const void *b) {
  uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
  return (x > y) - (x < y);
}

static void assert_edges_pair(const orb_supermesh *m) {
  size_t n = 3 * (size_t)m->triangle_count;
  uint64_t *forth = malloc(n * sizeof *forth), *back = malloc(n * sizeof *back);
  for (int32_t h = 0; h < 3 * m->triangle_count; h++) {
    uint64_t a = (uint64_t)m->triangles[h], b = (uint64_t)m->triangles[orb_next(h)];
    forth[h] = a << 32 | b;
    back[h] = b << 32 | a;
  }
  qsort(forth, n, sizeof *forth, compare_u64);
  qsort(back, n, sizeof *back, compare_u64);
  assert_memory_equal(forth, back, n * sizeof *forth);
  for (size_t i = 1; i < n; i++) {
    assert_true(forth[i] != forth[i - 1]);
  }
  free(forth);
  free(back);
}

void sphere_assert_valid(const orb_supermesh *m, const orb_aligned_shape *shapes, int count) {
  assert_int_equal(m->shape_count, count);
  assert_int_equal(m->triangle_count, 2 * m->vertex_count - 4);
  assert_int_equal(m->flipped, 0);
  assert_int_equal(m->degree, 1);
  assert_edges_pair(m);
  double angle = 0;
  for (int32_t t = 0; t < m->triangle_count; t++) {
    const double *a = m->points + 3 * (size_t)m->triangles[3 * t], *b = m->points + 3 * (size_t)m->triangles[3 * t + 1],
                 *c = m->points + 3 * (size_t)m->triangles[3 * t + 2];
    assert_int_equal(orb_orient(a, b, c), 1);
    angle += 2 * atan2(orb_det(a, b, c), 1 + orb_dot(a, b) + orb_dot(b, c) + orb_dot(c, a));
  }
  assert_true(fabs(angle - 4 * M_PI) < 1e-6);
  for (int32_t v = 0; v < m->vertex_count; v++) {
    assert_true(fabs(orb_length(m->points + 3 * (size_t)v) - 1) < 1e-12);
  }
  for (int s = 0; s < count; s++) {
    for (int32_t v = 0; v < m->vertex_count; v++) {
      const orb_place *place = &m->places[(size_t)s * (size_t)m->vertex_count + (size_t)v];
      assert_in_range(place->triangle, 0, shapes[s].mesh.triangle_count - 1);
      assert_true(place->at[0] >= 0 && place->at[1] >= 0 && place->at[2] >= 0);
      assert_true(fabs(place->at[0] + place->at[1] + place->at[2] - 1) < 1e-14);
    }
  }
}
