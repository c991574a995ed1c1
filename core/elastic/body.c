#include "elastic/body.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "numeric/vec3.h"

/* Half cotangents. Below 0 the energy has no minimum; far above 1 the triangle is a sliver of the decimation. */
static const double LEAST_WEIGHT = 0.05, MOST_WEIGHT = 5;

void orb_body_normals(const orb_mesh *m, const double *x, double *normal, double *mass) {
  memset(normal, 0, 3 * (size_t)m->vertex_count * sizeof *normal);
  if (mass) {
    memset(mass, 0, (size_t)m->vertex_count * sizeof *mass);
  }
  for (int32_t t = 0; t < m->triangle_count; t++) {
    const int32_t *v = m->triangles + 3 * (size_t)t;
    double n[3];
    orb_triangle_normal_at(x, v, n);
    double area = orb_length(n) / 2;
    for (int k = 0; k < 3; k++) {
      for (int i = 0; i < 3; i++) {
        normal[3 * (size_t)v[k] + (size_t)i] += n[i];
      }
      if (mass) {
        mass[v[k]] += area / 3;
      }
    }
  }
  for (int32_t v = 0; v < m->vertex_count; v++) {
    (void)orb_normalize(normal + 3 * (size_t)v);
  }
}

/* Half the cotangent at the corner opposite to the half-edge h. */
static double half_cotangent(const orb_mesh *mesh, size_t h) {
  const int32_t *v = mesh->triangles + h / 3 * 3;
  const double *o = mesh->positions + 3 * (size_t)v[(h + 2) % 3];
  double u[3], w[3], c[3];
  orb_sub(mesh->positions + 3 * (size_t)v[h % 3], o, u);
  orb_sub(mesh->positions + 3 * (size_t)v[(h + 1) % 3], o, w);
  orb_cross(u, w, c);
  double area2 = orb_length(c), value = area2 > 0 ? orb_dot(u, w) / area2 / 2 : 0;
  return fmin(MOST_WEIGHT, fmax(LEAST_WEIGHT, value));
}

/* Lists the half-edges at each vertex, that is each edge twice. filled: room for a number per vertex, zeroed. */
static void list_half_edges(orb_body *b, int32_t *filled) {
  const orb_mesh *mesh = b->mesh;
  size_t h = 3 * (size_t)mesh->triangle_count;
  for (size_t i = 0; i < h; i++) {
    b->start[mesh->triangles[i] + 1] += 2; /* as many half-edges end at a vertex as leave it */
  }
  for (int32_t v = 0; v < b->count; v++) {
    b->start[v + 1] += b->start[v];
  }
  for (size_t i = 0; i < h; i++) {
    const int32_t *v = mesh->triangles + i / 3 * 3, end[2] = {v[i % 3], v[(i + 1) % 3]};
    double weight = half_cotangent(mesh, i);
    for (int k = 0; k < 2; k++) {
      int32_t at = b->start[end[k]] + filled[end[k]]++;
      b->next[at] = end[1 - k];
      b->weight[at] = weight;
    }
  }
}

/* Merges the two half-edges of each edge, in the order of the first ones. at: room for a number per vertex. */
static void merge_edges(orb_body *b, int32_t *at) {
  int32_t count = 0, begin = 0;
  memset(at, -1, (size_t)b->count * sizeof *at);
  for (int32_t v = 0; v < b->count; v++) {
    const int32_t first = count, end = b->start[v + 1];
    for (int32_t i = begin; i < end; i++) {
      const int32_t u = b->next[i];
      if (at[u] >= first) {
        b->weight[at[u]] += b->weight[i];
      } else {
        at[u] = count;
        b->next[count] = u;
        b->weight[count++] = b->weight[i];
      }
    }
    begin = end;
    b->start[v + 1] = count;
  }
}

orb_status orb_body_create(orb_context *ctx, const orb_mesh *mesh, orb_body *out) {
  size_t n = (size_t)mesh->vertex_count, h = 3 * (size_t)mesh->triangle_count;
  out->mesh = mesh;
  out->count = mesh->vertex_count;
  out->normal = ORB_NEW(ctx, double, 3 * n);
  out->mass = ORB_NEW(ctx, double, n);
  out->start = ORB_NEW0(ctx, int32_t, n + 1);
  out->next = ORB_NEW(ctx, int32_t, 2 * h);
  out->weight = ORB_NEW(ctx, double, 2 * h);
  int32_t *filled = ORB_NEW0(ctx, int32_t, n);
  orb_status status = ORB_OK;
  if (!out->normal || !out->mass || !out->start || !out->next || !out->weight || !filled) {
    status = ORB_E_NO_MEMORY;
  }
  if (status == ORB_OK) {
    orb_body_normals(mesh, mesh->positions, out->normal, out->mass);
    list_half_edges(out, filled);
    merge_edges(out, filled);
    status = orb_searched_create(ctx, mesh->positions, out->normal, out->count, &out->searched);
  }
  if (status == ORB_OK) {
    orb_searched_fill(mesh->positions, out->normal, &out->searched);
  }
  orb_free(ctx, filled);
  return status;
}

void orb_body_free(orb_context *ctx, orb_body *b) {
  orb_free(ctx, b->normal);
  orb_free(ctx, b->mass);
  orb_searched_free(ctx, &b->searched);
  orb_free(ctx, b->start);
  orb_free(ctx, b->next);
  orb_free(ctx, b->weight);
  memset(b, 0, sizeof *b);
}
