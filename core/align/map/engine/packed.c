/* The fixed shape along a space-filling curve, for sweeps.
 *
 * Sweeps visit the moving vertices along such a curve, and each vertex reads the fixed shape at its place. In the order
 * of a file, neighbours on the surface may lie anywhere in memory, as in many scanned and edited meshes; a step then
 * spends much of its time waiting for memory.
 */
#include "align/map/engine/packed.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "embed/common/corner_table.h"
#include "numeric/vec3.h"

void orb_map_packed_free(orb_context *ctx, orb_map_packed *p) {
  orb_map_surface_free(ctx, &p->b);
  orb_free(ctx, p->s);
  orb_free(ctx, p->triangles);
  orb_free(ctx, p->vertex_row);
  orb_free(ctx, p->triangle_row);
  orb_free(ctx, p->rotation);
  orb_free(ctx, p->vertex);
  orb_free(ctx, p->to);
  orb_free(ctx, p->from);
  memset(p, 0, sizeof *p);
}

static int32_t least_corner(const int32_t *triangle, const int32_t *number) {
  int32_t a = number[triangle[0]], b = number[triangle[1]], c = number[triangle[2]];
  a = a < b ? a : b;
  return a < c ? a : c;
}

/* Orders triangles by their least vertex. number: of each vertex, packed; first: vertex_count + 1 zeros. */
static void order_triangles(const orb_map_surface *b, const int32_t *number, int32_t *first, orb_map_packed *p) {
  for (int32_t t = 0; t < b->triangle_count; t++) {
    first[least_corner(b->triangles + 3 * (size_t)t, number) + 1]++;
  }
  for (int32_t v = 0; v < b->vertex_count; v++) {
    first[v + 1] += first[v];
  }
  for (int32_t t = 0; t < b->triangle_count; t++) {
    p->to[t] = first[least_corner(b->triangles + 3 * (size_t)t, number)]++;
    p->from[p->to[t]] = t;
  }
}

/* Corners keep their order within their triangles. */
static void copy_surface(const orb_map_surface *b, const orb_corner_table *s, orb_map_packed *p) {
  for (int32_t i = 0; i < b->vertex_count; i++) {
    size_t v = (size_t)s->to_mesh[i], to = 3 * (size_t)i;
    memcpy(p->b.x + to, b->x + 3 * v, sizeof(double[3]));
    memcpy(p->b.normal + to, b->normal + 3 * v, sizeof(double[3]));
    p->vertex[i] = (int32_t)v;
  }
  for (int32_t i = 0; i < b->triangle_count; i++) {
    int32_t t = p->from[i];
    memcpy(p->b.frame + 6 * (size_t)i, b->frame + 6 * (size_t)t, sizeof(double[6]));
    for (int32_t k = 0; k < 3; k++) {
      int32_t twin = b->twin[3 * t + k];
      p->triangles[3 * i + k] = s->from_mesh[b->triangles[3 * t + k]];
      p->b.twin[3 * i + k] = 3 * p->to[twin / 3] + twin % 3;
    }
  }
}

static void fill_vertex_row(const orb_map_surface *b, size_t v, double *row) {
  memcpy(row, b->x + 3 * v, sizeof(double[3]));
  memcpy(row + 6, b->normal + 3 * v, sizeof(double[3]));
}

static void fill_triangle_row(const orb_map_surface *b, size_t t, double *row) {
  const int32_t *v = b->triangles + 3 * t;
  const double *x0 = b->x + 3 * (size_t)v[0], *e1 = b->frame + 6 * t, *e2 = e1 + 3;
  double u[3], w[3];
  orb_sub(b->x + 3 * (size_t)v[1], x0, u);
  orb_sub(b->x + 3 * (size_t)v[2], x0, w);
  double u1 = orb_dot(u, e1), u2 = orb_dot(u, e2), w1 = orb_dot(w, e1), w2 = orb_dot(w, e2), det = u1 * w2 - u2 * w1;
  double inverse = det * det > ORB_MAP_FLAT * orb_dot(u, u) * orb_dot(w, w) ? 1 / det : NAN;
  row[0] = w2 * inverse;
  row[1] = -w1 * inverse;
  row[2] = -u2 * inverse;
  row[3] = u1 * inverse;
  memcpy(row + 4, e1, sizeof(double[6]));
}

/* Unfolding over the edge keeps the angle to it, so the tangents differ by a rotation of the plane. */
static void fill_rotation(const orb_map_surface *b, size_t t, int k, double rotation[2]) {
  const int32_t *v = b->triangles + 3 * t;
  const double *e = b->frame + 6 * t, *f = b->frame + 6 * ((size_t)b->twin[3 * t + (size_t)k] / 3);
  double edge[3];
  orb_sub(b->x + 3 * (size_t)v[(k + 1) % 3], b->x + 3 * (size_t)v[k], edge);
  orb_normalize(edge);
  double c = orb_dot(edge, e), s = orb_dot(edge, e + 3), twin_c = orb_dot(edge, f), twin_s = orb_dot(edge, f + 3);
  rotation[0] = c * twin_c + s * twin_s;
  rotation[1] = c * twin_s - s * twin_c;
}

static void fill_rows(orb_map_packed *p) {
  for (size_t v = 0; v < (size_t)p->b.vertex_count; v++) {
    fill_vertex_row(&p->b, v, p->vertex_row + ORB_MAP_ROW * v);
  }
  for (size_t t = 0; t < (size_t)p->b.triangle_count; t++) {
    fill_triangle_row(&p->b, t, p->triangle_row + ORB_MAP_ROW * t);
    for (int k = 0; k < 3; k++) {
      fill_rotation(&p->b, t, k, p->rotation + 2 * (3 * t + (size_t)k));
    }
  }
}

/* Rows have room that nothing fills: zeroed, so that whole vectors can be read. */
static int reserve(orb_context *ctx, orb_map_packed *p) {
  size_t n = (size_t)p->b.vertex_count, m = (size_t)p->b.triangle_count;
  p->b.x = ORB_NEW(ctx, double, 3 * n);
  p->b.normal = ORB_NEW(ctx, double, 3 * n);
  p->b.twin = ORB_NEW(ctx, int32_t, 3 * m);
  p->b.frame = ORB_NEW(ctx, double, 6 * m);
  p->b.density = ORB_NEW(ctx, double, m);
  p->s = ORB_NEW(ctx, double, 3 * n);
  p->triangles = ORB_NEW(ctx, int32_t, 3 * m);
  p->vertex_row = ORB_NEW0(ctx, double, (size_t)ORB_MAP_ROW *n);
  p->triangle_row = ORB_NEW0(ctx, double, (size_t)ORB_MAP_ROW *m);
  p->rotation = ORB_NEW(ctx, double, 6 * m);
  p->vertex = ORB_NEW(ctx, int32_t, n);
  p->to = ORB_NEW(ctx, int32_t, m);
  p->from = ORB_NEW(ctx, int32_t, m);
  return p->b.x && p->b.normal && p->b.twin && p->b.frame && p->b.density && p->s && p->triangles && p->vertex_row &&
         p->triangle_row && p->rotation && p->vertex && p->to && p->from;
}

void orb_map_packed_move(const orb_map_surface *b, orb_map_packed *p) {
  for (size_t i = 0; i < (size_t)b->vertex_count; i++) {
    const double *s = b->s + 3 * (size_t)p->vertex[i];
    memcpy(p->s + 3 * i, s, sizeof(double[3]));
    memcpy(p->vertex_row + ORB_MAP_ROW * i + 3, s, sizeof(double[3]));
  }
  for (size_t i = 0; i < (size_t)b->triangle_count; i++) {
    p->b.density[i] = p->triangle_row[ORB_MAP_ROW * i + 10] = b->density[p->from[i]];
  }
}

orb_status orb_map_packed_create(orb_context *ctx, const orb_mesh *mesh, const orb_map_surface *b,
                                 orb_map_packed *out) {
  orb_map_packed p = {.b = {.vertex_count = b->vertex_count, .triangle_count = b->triangle_count}};
  orb_corner_table s = {0};
  int32_t *first = ORB_NEW0(ctx, int32_t, (size_t)b->vertex_count + 1);
  orb_status status = ORB_E_NO_MEMORY;
  if (!reserve(ctx, &p) || !first) {
    goto done;
  }
  ORB_GO(status, orb_corner_table_create(ctx, mesh, &s), done);
  order_triangles(b, s.from_mesh, first, &p);
  copy_surface(b, &s, &p);
  p.b.s = p.s;
  p.b.triangles = p.triangles;
  fill_rows(&p);
  orb_map_packed_move(b, &p);
done:
  orb_free(ctx, first);
  orb_corner_table_free(ctx, &s);
  if (status == ORB_OK) {
    *out = p;
  } else {
    orb_map_packed_free(ctx, &p);
  }
  return status;
}

void orb_map_packed_enter(const orb_map_packed *p, orb_map_level *l) {
  for (int32_t v = 0; v < l->count; v++) {
    l->place[v].triangle = p->to[l->place[v].triangle];
    l->density[v] = p->b.density[l->place[v].triangle];
  }
}

void orb_map_packed_leave(const orb_map_packed *p, orb_map_level *l) {
  for (int32_t v = 0; v < l->count; v++) {
    l->place[v].triangle = p->from[l->place[v].triangle];
  }
}
