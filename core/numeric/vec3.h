/* Vectors of three doubles, as plain arrays.
 *
 * The folder depends on core/base only: vec3.h, frame (tangent planes), predicates (exact orientations), dense (linear
 * solver, singular values), factor (sparse linear solver), rotation (nearest rotation), rotate_along.h (rotation from
 * one direction to another), clones.h (one function for several vector widths), lanes.inc.h (short vectors, for loops
 * that are compiled for several instruction sets). */
#ifndef ORB_NUMERIC_VEC3_H
#define ORB_NUMERIC_VEC3_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

/* Keeps a divisor from being 0. It is far below the rounding of every length, area and determinant of a shape, so
 * adding it changes no other quotient. */
static const double ORB_TINY = 1e-300;

static inline double orb_dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void orb_cross(const double a[3], const double b[3], double out[3]) {
  double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
  out[0] = x;
  out[1] = y;
  out[2] = z;
}

static inline void orb_sub(const double a[3], const double b[3], double out[3]) {
  out[0] = a[0] - b[0];
  out[1] = a[1] - b[1];
  out[2] = a[2] - b[2];
}

static inline double orb_distance2(const double a[3], const double b[3]) {
  double d[3];
  orb_sub(a, b, d);
  return orb_dot(d, d);
}

static inline double orb_length(const double a[3]) {
  return sqrt(orb_dot(a, a));
}

/* Scales to unit length; returns the old length. A zero vector stays zero. */
static inline double orb_normalize(double a[3]) {
  double length = orb_length(a);
  if (length > 0) {
    a[0] /= length;
    a[1] /= length;
    a[2] /= length;
  }
  return length;
}

/* n: the normal of the triangle a, b, c, twice its area long. */
static inline void orb_triangle_normal(const double a[3], const double b[3], const double c[3], double n[3]) {
  double u[3], w[3];
  orb_sub(b, a, u);
  orb_sub(c, a, w);
  orb_cross(u, w, n);
}

static inline double orb_triangle_area(const double a[3], const double b[3], const double c[3]) {
  double n[3];
  orb_triangle_normal(a, b, c, n);
  return 0.5 * orb_length(n);
}

/* The same for the triangle with the vertices v; x: 3 coordinates each. */
static inline void orb_triangle_normal_at(const double *x, const int32_t v[3], double n[3]) {
  orb_triangle_normal(x + 3 * (size_t)v[0], x + 3 * (size_t)v[1], x + 3 * (size_t)v[2], n);
}

static inline double orb_triangle_area_at(const double *x, const int32_t v[3]) {
  return orb_triangle_area(x + 3 * (size_t)v[0], x + 3 * (size_t)v[1], x + 3 * (size_t)v[2]);
}

/* h += weight · y xᵀ; h: 3×3, row-major. */
static inline void orb_add_outer(double h[9], const double y[3], const double x[3], double weight) {
  for (int k = 0; k < 9; k++) {
    h[k] += weight * y[k / 3] * x[k % 3];
  }
}

/* The cofactors of a row-major matrix, row by row. Returns its determinant. Divided by that, they are its inverse,
 * transposed. */
static inline double orb_cofactors(const double m[9], double c[9]) {
  orb_cross(m + 3, m + 6, c);
  orb_cross(m + 6, m, c + 3);
  orb_cross(m, m + 3, c + 6);
  return orb_dot(m, c);
}

/* det(a, b, c), computed from differences to a, so that close points lose no digits. */
static inline double orb_det(const double a[3], const double b[3], const double c[3]) {
  double n[3];
  orb_triangle_normal(a, b, c, n);
  return orb_dot(a, n);
}

#endif
