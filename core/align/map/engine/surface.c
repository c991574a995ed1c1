/* The fixed shape of a composed map: frames, normals, and straight lines over its triangles. */
#include <math.h>
#include <string.h>

#include "align/map/engine/params.h"
#include "align/map/engine/surface.h"
#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

static const double NO_WIDTH = 1e-12;   /* a triangle whose apex is this near to the line of its base has no normal */
static const double NOT_PARALLEL = 0.6; /* cosine: an axis at a greater angle is far from parallel to an edge */
static const double LEAST_TWICE_AREA = 1e-12; /* added to an area that is divided by; shapes have area 4π */

void orb_map_surface_free(orb_context *ctx, orb_map_surface *b) {
  orb_locator_destroy(ctx, b->locator);
  orb_free(ctx, b->x);
  orb_free(ctx, b->normal);
  orb_free(ctx, b->twin);
  orb_free(ctx, b->frame);
  orb_free(ctx, b->density);
  memset(b, 0, sizeof *b);
}

/* A weighted sum of normals, by radians, that is only rounding: the vertex is on the edge of a sheet that is folded
 * onto itself, and has no normal. */
static const double FOLDED = 1e-6;

void orb_map_normals(const double *x, int32_t vertex_count, const int32_t *triangles, int32_t triangle_count,
                     double *out) {
  memset(out, 0, 3 * (size_t)vertex_count * sizeof *out);
  for (int32_t h = 0; h < 3 * triangle_count; h++) {
    int32_t v = triangles[h];
    const double *p = x + 3 * (size_t)v, *q = x + 3 * (size_t)triangles[orb_next(h)];
    const double *r = x + 3 * (size_t)triangles[orb_prev(h)];
    double u[3], w[3], n[3];
    orb_sub(q, p, u);
    orb_sub(r, p, w);
    orb_cross(u, w, n);
    double doubled = orb_length(n), angle = atan2(doubled, orb_dot(u, w));
    for (int k = 0; k < 3 && doubled > 0; k++) {
      out[3 * (size_t)v + (size_t)k] += angle * n[k] / doubled;
    }
  }
  for (int32_t v = 0; v < vertex_count; v++) {
    if (!(orb_normalize(out + 3 * (size_t)v) > FOLDED)) {
      memset(out + 3 * (size_t)v, 0, 3 * sizeof *out);
    }
  }
}

/* Two orthonormal tangents of a triangle; any two if it is degenerate. */
static void make_frame(const double *p, const double *q, const double *r, double frame[6]) {
  double *e = frame, *f = frame + 3;
  orb_sub(q, p, e);
  if (!(orb_normalize(e) > 0)) {
    e[0] = 1;
    e[1] = e[2] = 0;
  }
  orb_sub(r, p, f);
  double along = orb_dot(e, f);
  for (int k = 0; k < 3; k++) {
    f[k] -= along * e[k];
  }
  if (!(orb_normalize(f) > NO_WIDTH)) {
    const double axis[3] = {fabs(e[0]) < NOT_PARALLEL, fabs(e[0]) >= NOT_PARALLEL, 0};
    orb_cross(e, axis, f);
    orb_normalize(f);
  }
}

static void fill_density(orb_map_surface *b) {
  for (int32_t t = 0; t < b->triangle_count; t++) {
    const int32_t *v = b->triangles + 3 * (size_t)t;
    double n[3];
    orb_triangle_normal_at(b->x, v, n);
    b->density[t] = orb_det(b->s + 3 * (size_t)v[0], b->s + 3 * (size_t)v[1], b->s + 3 * (size_t)v[2]) /
                    (orb_length(n) + LEAST_TWICE_AREA);
  }
}

orb_status orb_map_surface_move(orb_context *ctx, orb_map_surface *b, const double *s) {
  orb_locator *locator;
  ORB_TRY(orb_locator_create(ctx, s, b->vertex_count, b->triangles, b->triangle_count, b->twin, &locator));
  orb_locator_destroy(ctx, b->locator);
  b->locator = locator;
  b->s = s;
  fill_density(b);
  return ORB_OK;
}

orb_status orb_map_surface_create(orb_context *ctx, const orb_aligned_shape *shape, orb_map_surface *out) {
  const orb_mesh *mesh = &shape->mesh;
  orb_map_surface b = {
      .vertex_count = mesh->vertex_count, .triangle_count = mesh->triangle_count, .triangles = mesh->triangles};
  orb_status status = ORB_E_NO_MEMORY;
  b.x = ORB_NEW(ctx, double, 3 * (size_t)b.vertex_count);
  b.normal = ORB_NEW(ctx, double, 3 * (size_t)b.vertex_count);
  b.twin = ORB_NEW(ctx, int32_t, 3 * (size_t)b.triangle_count);
  b.frame = ORB_NEW(ctx, double, 6 * (size_t)b.triangle_count);
  b.density = ORB_NEW(ctx, double, b.triangle_count);
  if (!b.x || !b.normal || !b.twin || !b.frame || !b.density) {
    goto fail;
  }
  ORB_GO(status, orb_mesh_twins(ctx, b.triangles, b.triangle_count, b.vertex_count, b.twin), fail);
  orb_extent extent;
  orb_mesh_extent(mesh, &extent);
  b.scale = extent.area > 0 ? sqrt(4 * M_PI / extent.area) : 1;
  for (int k = 0; k < 3; k++) {
    b.centre[k] = 0.5 * extent.min[k] + 0.5 * extent.max[k];
  }
  for (int32_t i = 0; i < 3 * b.vertex_count; i++) {
    b.x[i] = (mesh->positions[i] - b.centre[i % 3]) * b.scale;
  }
  orb_map_normals(b.x, b.vertex_count, b.triangles, b.triangle_count, b.normal);
  for (int32_t t = 0; t < b.triangle_count; t++) {
    const int32_t *v = b.triangles + 3 * (size_t)t;
    make_frame(b.x + 3 * (size_t)v[0], b.x + 3 * (size_t)v[1], b.x + 3 * (size_t)v[2], b.frame + 6 * (size_t)t);
  }
  ORB_GO(status, orb_map_surface_move(ctx, &b, shape->points), fail);
  *out = b;
  return ORB_OK;
fail:
  orb_map_surface_free(ctx, &b);
  return status;
}

static void blend(const double *base, const int32_t *v, const double at[3], double out[3]) {
  for (int k = 0; k < 3; k++) {
    out[k] = at[0] * base[3 * (size_t)v[0] + (size_t)k] + at[1] * base[3 * (size_t)v[1] + (size_t)k] +
             at[2] * base[3 * (size_t)v[2] + (size_t)k];
  }
}

void orb_map_surface_at(const orb_map_surface *b, const orb_place *place, double y[3], double x[3], double n[3]) {
  const int32_t *v = b->triangles + 3 * (size_t)place->triangle;
  if (y) {
    blend(b->x, v, place->at, y);
  }
  if (x) {
    blend(b->s, v, place->at, x);
    orb_normalize(x);
  }
  if (n) {
    blend(b->normal, v, place->at, n);
    orb_normalize(n);
  }
}

int32_t orb_map_nearest_corner(const int32_t *triangles, const orb_place *place) {
  int corner = place->at[1] > place->at[0] ? 1 : 0;
  corner = place->at[2] > place->at[corner] ? 2 : corner;
  return triangles[3 * (size_t)place->triangle + (size_t)corner];
}

/* Clamps negative coordinates, which come from rounding, and makes the sum 1. */
static void tidy(double at[3]) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    at[k] = at[k] > 0 ? at[k] : 0;
    sum += at[k];
  }
  for (int k = 0; k < 3; k++) {
    at[k] /= sum;
  }
}

/* Carries a direction over the edge a→b of the triangle with apex `from` into the one with apex `to`. */
static int unfold(const double *a, const double *b, const double *from, const double *to, double d[3]) {
  double edge[3], in[3], out[3];
  orb_sub(b, a, edge);
  if (!(orb_normalize(edge) > 0)) {
    return 0;
  }
  orb_sub(from, a, in);
  orb_sub(to, a, out);
  double p = orb_dot(in, edge), q = orb_dot(out, edge);
  for (int k = 0; k < 3; k++) {
    in[k] -= p * edge[k];
    out[k] -= q * edge[k];
  }
  if (!(orb_normalize(in) > 0) || !(orb_normalize(out) > 0)) {
    return 0;
  }
  double along = orb_dot(d, edge), across = -orb_dot(d, in);
  across = across > 0 ? across : 0;
  for (int k = 0; k < 3; k++) {
    d[k] = along * edge[k] + across * out[k];
  }
  return 1;
}

/* Barycentric rates of a direction in a triangle; 0 where it has no area. */
static int rates(const double *const p[3], const double d[3], double rate[3]) {
  double e1[3], e2[3];
  orb_sub(p[1], p[0], e1);
  orb_sub(p[2], p[0], e2);
  double a11 = orb_dot(e1, e1), a12 = orb_dot(e1, e2), a22 = orb_dot(e2, e2), det = a11 * a22 - a12 * a12;
  if (!(det > ORB_MAP_FLAT * a11 * a22)) {
    return 0;
  }
  double b1 = orb_dot(e1, d), b2 = orb_dot(e2, d);
  rate[1] = (a22 * b1 - a12 * b2) / det;
  rate[2] = (a11 * b2 - a12 * b1) / det;
  rate[0] = -rate[1] - rate[2];
  return 1;
}

int orb_map_surface_trace(const orb_map_surface *b, const orb_place *from, const double step[2], orb_place *out) {
  int32_t t = from->triangle;
  int came = -1; /* the corner opposite to the edge that was crossed */
  double at[3], d[3];
  memcpy(at, from->at, sizeof at);
  for (int k = 0; k < 3; k++) {
    d[k] = step[0] * b->frame[6 * (size_t)t + (size_t)k] + step[1] * b->frame[6 * (size_t)t + 3 + (size_t)k];
  }
  for (int crossing = 0; crossing < ORB_MAP_CROSSINGS; crossing++) {
    const int32_t *v = b->triangles + 3 * (size_t)t;
    const double *const p[3] = {b->x + 3 * (size_t)v[0], b->x + 3 * (size_t)v[1], b->x + 3 * (size_t)v[2]};
    double rate[3], end = 1;
    int leave = -1;
    if (!rates(p, d, rate)) {
      return 0;
    }
    for (int k = 0; k < 3; k++) {
      if (k != came && rate[k] < 0 && at[k] < -rate[k] * end) {
        end = at[k] / -rate[k];
        leave = k;
      }
    }
    for (int k = 0; k < 3; k++) {
      at[k] += end * rate[k];
      d[k] *= 1 - end;
    }
    if (leave < 0) {
      tidy(at);
      out->triangle = t;
      memcpy(out->at, at, sizeof at);
      return 1;
    }
    at[leave] = 0;
    tidy(at);
    int i = (leave + 1) % 3, j = (leave + 2) % 3;
    int32_t g = b->twin[3 * t + i], k = g % 3; /* half-edge v[j]→v[i] of the next triangle */
    if (!unfold(p[i], p[j], p[leave], b->x + 3 * (size_t)b->triangles[orb_prev(g)], d)) {
      return 0;
    }
    double next[3];
    next[k] = at[j];
    next[(k + 1) % 3] = at[i];
    next[(k + 2) % 3] = 0;
    memcpy(at, next, sizeof at);
    came = (k + 2) % 3;
    t = g / 3;
  }
  return 0;
}
