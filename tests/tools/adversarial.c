#include "adversarial.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct rng {
  uint64_t state;
} rng;

/* SplitMix64. */
static uint64_t next_bits(rng *r) {
  uint64_t z = (r->state += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}
static double unit(rng *r) {
  return (double)(next_bits(r) >> 11) * 0x1p-53;
}
static int32_t below(rng *r, int32_t n) {
  return (int32_t)(next_bits(r) % (uint64_t)n);
}

static void *grab(size_t count, size_t size) {
  void *p = calloc(count ? count : 1, size);
  if (!p) {
    fprintf(stderr, "adversarial: out of memory\n");
    exit(1);
  }
  return p;
}

const char *adversarial_name(adversarial_kind kind) {
  static const char *const names[ADV_KIND_COUNT] = {"cylinder", "spiral", "neck",      "urchin",     "noise",
                                                    "crumple",  "comb",   "flattened", "duplicated", "all-equal",
                                                    "pole",     "random", "limbs",     "needles"};
  return names[kind];
}

void adversarial_free(adversarial_mesh *mesh) {
  free(mesh->positions);
  free(mesh->triangles);
  memset(mesh, 0, sizeof *mesh);
}

static adversarial_mesh blank(int32_t vertices, int32_t triangles) {
  return (adversarial_mesh){vertices, triangles, grab((size_t)vertices, 3 * sizeof(double)),
                            grab((size_t)triangles, 3 * sizeof(int32_t))};
}

static void set_triangle(adversarial_mesh *m, int32_t t, int32_t a, int32_t b, int32_t c) {
  m->triangles[3 * t] = a;
  m->triangles[3 * t + 1] = b;
  m->triangles[3 * t + 2] = c;
}

/* A globe of `rows` − 1 circles of `columns` vertices and two poles. Vertex 1 + (i−1)·columns + j lies on circle i. */
static adversarial_mesh globe(int32_t rows, int32_t columns) {
  adversarial_mesh m = blank(2 + (rows - 1) * columns, 2 * columns * (rows - 1));
  int32_t t = 0, south = m.vertex_count - 1;
  for (int32_t j = 0; j < columns; j++) {
    int32_t k = (j + 1) % columns, bottom = 1 + (rows - 2) * columns;
    set_triangle(&m, t++, 0, 1 + j, 1 + k);
    set_triangle(&m, t++, bottom + j, south, bottom + k);
    for (int32_t i = 1; i < rows - 1; i++) {
      int32_t a = 1 + (i - 1) * columns + j, b = 1 + (i - 1) * columns + k, c = a + columns, d = b + columns;
      set_triangle(&m, t++, a, c, d);
      set_triangle(&m, t++, a, d, b);
    }
  }
  for (int32_t i = 0; i <= rows; i++) {
    double polar = M_PI * i / rows;
    int32_t count = i == 0 || i == rows ? 1 : columns, first = i == 0 ? 0 : i == rows ? south : 1 + (i - 1) * columns;
    for (int32_t j = 0; j < count; j++) {
      double *p = m.positions + 3 * (size_t)(first + j), turn = 2 * M_PI * j / columns;
      p[0] = sin(polar) * cos(turn);
      p[1] = sin(polar) * sin(turn);
      p[2] = cos(polar);
    }
  }
  return m;
}

/* A globe drawn over a curve: circle i is swept to centre c with radius r. */
typedef void (*curve_fn)(double t, double centre[3], double *radius, double u[3], double w[3], const double *shape);

static adversarial_mesh tube(curve_fn curve, int32_t triangles, int32_t columns, const double *shape) {
  int32_t rows = triangles / (2 * columns) + 1;
  adversarial_mesh m = globe(rows < 3 ? 3 : rows, columns);
  rows = rows < 3 ? 3 : rows;
  for (int32_t v = 0; v < m.vertex_count; v++) {
    int32_t i = v == 0 ? 0 : v == m.vertex_count - 1 ? rows : 1 + (v - 1) / columns;
    double turn = v ? 2 * M_PI * ((v - 1) % columns) / columns : 0, c[3], r, u[3], w[3];
    curve((double)i / rows, c, &r, u, w, shape);
    double a = i == 0 || i == rows ? 0 : r * cos(turn), b = i == 0 || i == rows ? 0 : r * sin(turn);
    for (int k = 0; k < 3; k++) {
      m.positions[3 * (size_t)v + (size_t)k] = c[k] + a * u[k] + b * w[k];
    }
  }
  return m;
}

static void straight(double t, double c[3], double *r, double u[3], double w[3], const double *shape) {
  const double frame[6] = {1, 0, 0, 0, 1, 0};
  c[0] = c[1] = 0;
  c[2] = -shape[0] * t;
  *r = sqrt(fmax(1e-9, 1 - pow(2 * t - 1, 20)));
  memcpy(u, frame, sizeof(double[3]));
  memcpy(w, frame + 3, sizeof(double[3]));
}

static void spiral(double t, double c[3], double *r, double u[3], double w[3], const double *shape) {
  double angle = shape[0] * 2 * M_PI * t, reach = 2 + 2 * shape[0] * t;
  c[0] = reach * cos(angle);
  c[1] = reach * sin(angle);
  c[2] = 0;
  *r = 0.6 * sqrt(fmax(1e-6, 1 - pow(2 * t - 1, 60)));
  u[0] = cos(angle);
  u[1] = sin(angle);
  u[2] = 0;
  w[0] = w[1] = 0;
  w[2] = -1;
}

static void neck(double t, double c[3], double *r, double u[3], double w[3], const double *shape) {
  double left = t < 0.15 ? 2 * sqrt(fmax(1e-6, 1 - pow((t - 0.1) / 0.1, 2))) : 0;
  double right = t > 0.85 ? 2 * sqrt(fmax(1e-6, 1 - pow((t - 0.9) / 0.1, 2))) : 0;
  straight(t, c, r, u, w, (const double[]){20});
  *r = fmax(fmax(left, right), t > 0.02 && t < 0.98 ? shape[0] : 1e-4);
}

/* Splits each triangle of an octahedron in four, `levels` times, on the unit sphere. */
static adversarial_mesh ball(int32_t triangles) {
  int32_t n = 1;
  while (8 * (n + 1) * (n + 1) <= triangles) {
    n++;
  }
  /* Rows of an octahedron by frequency n: ring i of the upper half has 4i vertices. */
  int32_t vertices = 4 * n * n + 2;
  adversarial_mesh m = blank(vertices, 8 * n * n);
  int32_t *start = grab((size_t)(2 * n + 2), sizeof *start), at = 0, t = 0;
  for (int32_t i = 0; i <= 2 * n; i++) {
    int32_t k = i <= n ? i : 2 * n - i, count = k ? 4 * k : 1;
    start[i] = at;
    for (int32_t j = 0; j < count; j++, at++) {
      double height = 1 - (double)i / n, reach = 1 - fabs(height), s = k ? (double)(j % k) / k : 0;
      int quarter = k ? j / k : 0;
      double a = reach * (1 - s), b = reach * s, x = quarter == 0 ? a : quarter == 1 ? -b : quarter == 2 ? -a : b;
      double y = quarter == 0   ? b
                 : quarter == 1 ? a
                 : quarter == 2 ? -b
                                : -a,
             l = sqrt(x * x + y * y + height * height);
      double *p = m.positions + 3 * (size_t)at;
      p[0] = x / l;
      p[1] = y / l;
      p[2] = height / l;
    }
  }
  for (int32_t i = 0; i < 2 * n; i++) {
    int up = i < n;
    int32_t small = up ? i : 2 * n - i - 1, big = small + 1, s = start[up ? i : i + 1], b = start[up ? i + 1 : i];
    for (int q = 0; q < 4; q++) {
      for (int32_t j = 0; j < big; j++) {
        int32_t outer = b + (q * big + j) % (4 * big), outer2 = b + (q * big + j + 1) % (4 * big);
        int32_t inner = small ? s + (q * small + j) % (4 * small) : s;
        set_triangle(&m, t++, up ? outer : outer2, up ? outer2 : outer, inner);
        if (j + 1 < big) {
          int32_t inner2 = s + (q * small + j + 1) % (4 * small);
          set_triangle(&m, t++, up ? inner : inner2, outer2, up ? inner2 : inner);
        }
      }
    }
  }
  free(start);
  return m;
}

static void scale_vertex(double *p, double s) {
  p[0] *= s;
  p[1] *= s;
  p[2] *= s;
}

/* Spikes at random directions; with `branches`, each carries thinner ones on its side. */
static adversarial_mesh spiked(rng *r, int32_t triangles, int spikes, double height, double width) {
  adversarial_mesh m = ball(triangles);
  double(*axis)[3] = grab((size_t)spikes, sizeof *axis);
  for (int i = 0; i < spikes; i++) {
    double z = 2 * unit(r) - 1, a = 2 * M_PI * unit(r), s = sqrt(1 - z * z);
    axis[i][0] = s * cos(a);
    axis[i][1] = s * sin(a);
    axis[i][2] = z;
  }
  for (int32_t v = 0; v < m.vertex_count; v++) {
    double *p = m.positions + 3 * (size_t)v, grow = 1;
    for (int i = 0; i < spikes; i++) {
      double c = p[0] * axis[i][0] + p[1] * axis[i][1] + p[2] * axis[i][2], away = acos(fmin(1, fmax(-1, c))) / width;
      grow = fmax(grow, 1 + height * (1 + 0.5 * (i % 3)) * exp(-away * away));
    }
    scale_vertex(p, grow);
  }
  free(axis);
  return m;
}

static adversarial_mesh comb(rng *r, int32_t triangles) {
  adversarial_mesh m = ball(triangles);
  double teeth = 6 + below(r, 12), reach = 10 + 30 * unit(r);
  for (int32_t v = 0; v < m.vertex_count; v++) {
    double *p = m.positions + 3 * (size_t)v, wave = cos(teeth * M_PI * p[0]);
    double up = p[2] > 0 && fabs(p[1]) < 0.5 && wave > 0 ? wave * wave * p[2] : 0;
    p[2] += reach * up;
    p[0] *= 4;
  }
  return m;
}

/* A random triangulation: vertices inserted into random triangles, then edges flipped at random. */
static adversarial_mesh random_triangulation(rng *r, int32_t triangles) {
  int32_t n = triangles / 2 + 2 < 4 ? 4 : triangles / 2 + 2;
  adversarial_mesh m = blank(n, 2 * n - 4);
  set_triangle(&m, 0, 0, 1, 2);
  set_triangle(&m, 1, 0, 2, 3);
  set_triangle(&m, 2, 0, 3, 1);
  set_triangle(&m, 3, 1, 3, 2);
  int32_t count = 4;
  for (int32_t v = 4; v < n; v++, count += 2) {
    int32_t t = below(r, count), a = m.triangles[3 * t], b = m.triangles[3 * t + 1], c = m.triangles[3 * t + 2];
    set_triangle(&m, t, a, b, v);
    set_triangle(&m, count, b, c, v);
    set_triangle(&m, count + 1, c, a, v);
  }
  for (int32_t v = 0; v < n; v++) {
    for (int k = 0; k < 3; k++) {
      m.positions[3 * (size_t)v + (size_t)k] = 2 * unit(r) - 1;
    }
  }
  return m;
}

static void duplicate_places(adversarial_mesh *m, rng *r) {
  for (int32_t t = 0; t < m->triangle_count; t++) {
    if (unit(r) < 0.12) {
      memcpy(m->positions + 3 * (size_t)m->triangles[3 * t], m->positions + 3 * (size_t)m->triangles[3 * t + 1],
             sizeof(double[3]));
    }
  }
}

adversarial_mesh adversarial_make(adversarial_kind kind, uint64_t seed, int32_t triangles) {
  rng r = {seed * 0x2545f4914f6cdd1du + (uint64_t)kind};
  adversarial_mesh m;
  double shape[1];
  switch (kind) {
    case ADV_CYLINDER:
      shape[0] = 100 + 900 * unit(&r); /* over a diameter of 2: up to 1:500 */
      return tube(straight, triangles, 8 + below(&r, 16), shape);
    case ADV_SPIRAL:
      shape[0] = 2 + 6 * unit(&r);
      return tube(spiral, triangles, 8 + below(&r, 12), shape);
    case ADV_NECK:
      shape[0] = pow(10, -1 - 3 * unit(&r));
      return tube(neck, triangles, 16 + below(&r, 20), shape);
    case ADV_URCHIN:
      return spiked(&r, triangles, 20 + below(&r, 60), 2 + 8 * unit(&r), 0.06);
    case ADV_LIMBS:
      m = spiked(&r, triangles, 4 + below(&r, 5), 4 + 10 * unit(&r), 0.15);
      for (int32_t v = 0; v < m.vertex_count; v++) { /* limbs on limbs: side branches that grow with the distance */
        double *p = m.positions + 3 * (size_t)v, l = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        double wave = l > 2 ? pow(fmax(0, sin(3 * l)), 6) * fmax(0, sin(9 * atan2(p[1], p[0]))) : 0;
        p[0] *= 1 + 0.6 * wave;
        p[2] += wave * l;
      }
      return m;
    case ADV_NOISE:
    case ADV_CRUMPLE:
      m = ball(triangles);
      for (int32_t v = 0; v < m.vertex_count; v++) {
        scale_vertex(m.positions + 3 * (size_t)v, kind == ADV_NOISE ? 0.5 + unit(&r) : exp(5 * (unit(&r) - 0.5)));
      }
      return m;
    case ADV_COMB:
      return comb(&r, triangles);
    case ADV_FLATTENED:
      m = ball(triangles);
      for (int32_t v = 0; v < m.vertex_count; v++) {
        m.positions[3 * (size_t)v + 2] *= unit(&r) < 0.5 ? 1e-4 : 0;
        m.positions[3 * (size_t)v + 1] *= 1e-2;
      }
      return m;
    case ADV_DUPLICATED:
      m = ball(triangles);
      duplicate_places(&m, &r);
      return m;
    case ADV_ALL_EQUAL:
      m = below(&r, 2) ? ball(triangles) : random_triangulation(&r, triangles);
      for (int32_t v = 0; v < 3 * m.vertex_count; v++) {
        m.positions[v] = 0.25;
      }
      return m;
    case ADV_POLE: {
      int32_t columns = 200 + below(&r, 1801), rows = triangles / (2 * columns) + 1;
      m = globe(rows < 2 ? 2 : rows, columns);
      for (int32_t v = 0; v < m.vertex_count; v++) {
        scale_vertex(m.positions + 3 * (size_t)v, 1 + 0.3 * unit(&r));
      }
      return m;
    }
    case ADV_RANDOM:
      return random_triangulation(&r, triangles);
    case ADV_NEEDLES:
      m = ball(triangles);
      for (int32_t v = 0; v < m.vertex_count; v++) {
        double *p = m.positions + 3 * (size_t)v, turn = floor(40 * atan2(p[1], p[0])) / 40;
        double s = sqrt(p[0] * p[0] + p[1] * p[1]), blend = 1 - 1e-7 * unit(&r);
        p[0] += blend * (s * cos(turn) - p[0]);
        p[1] += blend * (s * sin(turn) - p[1]);
      }
      return m;
    case ADV_KIND_COUNT:
      break;
  }
  fprintf(stderr, "adversarial: no such kind\n");
  exit(1);
}
