/* The fixed shape along a space-filling curve, for sweeps.
 *
 * Sweeps visit the moving vertices along such a curve, and each vertex reads the fixed shape at its place. In the order
 * of a file, neighbours on the surface may lie anywhere in memory, as in many scanned and edited meshes; a step then
 * spends much of its time waiting for memory.
 */
#include <string.h>

#include "align/map/engine/packed.h"
#include "base/check.h"
#include "base/memory.h"
#include "embed/common/corner_table.h"

void orb_map_packed_free(orb_context *ctx, orb_map_packed *p) {
  orb_map_surface_free(ctx, &p->b);
  orb_free(ctx, p->s);
  orb_free(ctx, p->triangles);
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
    memcpy(p->s + to, b->s + 3 * v, sizeof(double[3]));
  }
  for (int32_t i = 0; i < b->triangle_count; i++) {
    int32_t t = p->from[i];
    memcpy(p->b.frame + 6 * (size_t)i, b->frame + 6 * (size_t)t, sizeof(double[6]));
    p->b.density[i] = b->density[t];
    for (int32_t k = 0; k < 3; k++) {
      int32_t twin = b->twin[3 * t + k];
      p->triangles[3 * i + k] = s->from_mesh[b->triangles[3 * t + k]];
      p->b.twin[3 * i + k] = 3 * p->to[twin / 3] + twin % 3;
    }
  }
}

orb_status orb_map_packed_create(orb_context *ctx, const orb_mesh *mesh, const orb_map_surface *b,
                                 orb_map_packed *out) {
  size_t n = (size_t)b->vertex_count, m = (size_t)b->triangle_count;
  orb_map_packed p = {.b = {.vertex_count = b->vertex_count, .triangle_count = b->triangle_count}};
  orb_corner_table s = {0};
  int32_t *first = ORB_NEW0(ctx, int32_t, n + 1);
  orb_status status = ORB_E_NO_MEMORY;
  p.b.x = ORB_NEW(ctx, double, 3 * n);
  p.b.normal = ORB_NEW(ctx, double, 3 * n);
  p.b.twin = ORB_NEW(ctx, int32_t, 3 * m);
  p.b.frame = ORB_NEW(ctx, double, 6 * m);
  p.b.density = ORB_NEW(ctx, double, m);
  p.s = ORB_NEW(ctx, double, 3 * n);
  p.triangles = ORB_NEW(ctx, int32_t, 3 * m);
  p.to = ORB_NEW(ctx, int32_t, m);
  p.from = ORB_NEW(ctx, int32_t, m);
  if (!first || !p.b.x || !p.b.normal || !p.b.twin || !p.b.frame || !p.b.density || !p.s || !p.triangles || !p.to ||
      !p.from) {
    goto done;
  }
  ORB_GO(status, orb_corner_table_create(ctx, mesh, &s), done);
  order_triangles(b, s.from_mesh, first, &p);
  copy_surface(b, &s, &p);
  p.b.s = p.s;
  p.b.triangles = p.triangles;
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
