#include "elastic/body.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "numeric/clones.h"
#include "numeric/vec3.h"

enum { BLOCK = 64, LANES = 16 }; /* vertices that are measured at once; and minima that are kept side by side */

static const double NORMAL_WEIGHT = 0.25; /* of |n − n'|² against |x − x'|², areas being 4π */
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
    orb_triangle_normal(x + 3 * (size_t)v[0], x + 3 * (size_t)v[1], x + 3 * (size_t)v[2], n);
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

orb_status orb_searched_create(orb_context *ctx, int32_t count, orb_searched *out) {
  out->columns = (count + BLOCK - 1) / BLOCK * BLOCK;
  out->at = ORB_NEW(ctx, float, 6 * (size_t)out->columns);
  return out->at ? ORB_OK : ORB_E_NO_MEMORY;
}

void orb_searched_fill(const double *position, const double *normal, int32_t count, orb_searched *out) {
  const double weight = sqrt(NORMAL_WEIGHT);
  for (int k = 0; k < 6; k++) {
    const double *from = k < 3 ? position : normal, factor = k < 3 ? 1 : weight;
    float *column = out->at + (size_t)k * (size_t)out->columns;
    for (int32_t i = 0; i < out->columns; i++) {
      column[i] = i < count ? (float)(factor * from[3 * (size_t)i + (size_t)(k % 3)]) : INFINITY;
    }
  }
}

/* Squared distances in position and normal of BLOCK vertices; returns the least. */
ORB_CLONES static float measure_block(const float *at, int32_t columns, const float q[6], float *out) {
  float lane[LANES];
  for (int i = 0; i < BLOCK; i++) {
    float sum = 0;
    for (int k = 0; k < 6; k++) {
      float d = at[k * (ptrdiff_t)columns + i] - q[k];
      sum += d * d;
    }
    out[i] = sum;
  }
  memcpy(lane, out, sizeof lane);
  for (int i = LANES; i < BLOCK; i += LANES) {
    for (int k = 0; k < LANES; k++) {
      lane[k] = out[i + k] < lane[k] ? out[i + k] : lane[k];
    }
  }
  float least = lane[0];
  for (int k = 1; k < LANES; k++) {
    least = lane[k] < least ? lane[k] : least;
  }
  return least;
}

int32_t orb_searched_nearest(const orb_searched *s, const double x[3], const double n[3]) {
  const float weight = (float)sqrt(NORMAL_WEIGHT);
  const float q[6] = {(float)x[0],          (float)x[1],          (float)x[2],
                      weight * (float)n[0], weight * (float)n[1], weight * (float)n[2]};
  float least = INFINITY, block[BLOCK];
  int32_t best = 0;
  for (int32_t first = 0; first < s->columns; first += BLOCK) {
    if (measure_block(s->at + first, s->columns, q, block) < least) {
      for (int i = 0; i < BLOCK; i++) {
        best = block[i] < least ? first + i : best;
        least = block[i] < least ? block[i] : least;
      }
    }
  }
  return best;
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

/* Lists the edges at each vertex. filled: room for a number a vertex, zeroed. */
static void list_edges(orb_body *b, int32_t *filled) {
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
  orb_status status = orb_searched_create(ctx, out->count, &out->searched);
  if (!out->normal || !out->mass || !out->start || !out->next || !out->weight || !filled) {
    status = ORB_E_NO_MEMORY;
  }
  if (status == ORB_OK) {
    orb_body_normals(mesh, mesh->positions, out->normal, out->mass);
    orb_searched_fill(mesh->positions, out->normal, out->count, &out->searched);
    list_edges(out, filled);
  }
  orb_free(ctx, filled);
  return status;
}

void orb_body_free(orb_context *ctx, orb_body *b) {
  orb_free(ctx, b->normal);
  orb_free(ctx, b->mass);
  orb_free(ctx, b->searched.at);
  orb_free(ctx, b->start);
  orb_free(ctx, b->next);
  orb_free(ctx, b->weight);
  memset(b, 0, sizeof *b);
}
