#include "spectral/distances.h"

#include <math.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* The length of the straight line between the vertices c and d opposite to edge a–b, with both triangles unfolded into
 * a plane; INFINITY where it does not cross the edge. */
static double across(const double *a, const double *b, const double *c, const double *d) {
  double e[3], u[3], w[3], length, cx, cy, dx, dy;
  orb_sub(b, a, e);
  length = orb_length(e);
  orb_sub(c, a, u);
  orb_sub(d, a, w);
  if (!(length > 0)) {
    return INFINITY;
  }
  cx = orb_dot(u, e) / length;
  dx = orb_dot(w, e) / length;
  cy = sqrt(fmax(0, orb_dot(u, u) - cx * cx));
  dy = sqrt(fmax(0, orb_dot(w, w) - dx * dx));
  double at = cy + dy > 0 ? (cx * dy + dx * cy) / (cy + dy) : -1;
  return at > 0 && at < length ? sqrt((cx - dx) * (cx - dx) + (cy + dy) * (cy + dy)) : INFINITY;
}

orb_status orb_distances_create(orb_context *ctx, const orb_mesh *mesh, orb_distances *g) {
  orb_status status = ORB_OK;
  int32_t half_edges = 3 * mesh->triangle_count, *twin = ORB_NEW(ctx, int32_t, half_edges);
  g->vertices = mesh->vertex_count;
  g->start = ORB_NEW0(ctx, int32_t, mesh->vertex_count + 2);
  g->link = ORB_NEW(ctx, orb_link, 2 * (size_t)half_edges);
  g->heap = ORB_NEW(ctx, orb_heap_item, 2 * (size_t)half_edges + 1);
  if (!twin || !g->start || !g->link || !g->heap) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, orb_mesh_twins(ctx, mesh->triangles, mesh->triangle_count, mesh->vertex_count, twin), end);
  for (int pass = 0; pass < 2; pass++) {
    int32_t *fill = g->start + (pass ? 1 : 2);
    for (int32_t h = 0; h < half_edges; h++) {
      int32_t a = mesh->triangles[h], b = mesh->triangles[orb_next(h)], c = mesh->triangles[orb_prev(h)],
              d = mesh->triangles[orb_prev(twin[h])];
      if (!pass) {
        fill[a]++;
        fill[c]++;
        continue;
      }
      const double *x = mesh->positions, *pa = x + 3 * (size_t)a, *pb = x + 3 * (size_t)b;
      g->link[fill[a]++] = (orb_link){b, sqrt(orb_distance2(pa, pb))};
      g->link[fill[c]++] = (orb_link){d, across(pa, pb, x + 3 * (size_t)c, x + 3 * (size_t)d)};
    }
    for (int32_t v = 0; v < mesh->vertex_count && !pass; v++) {
      g->start[v + 2] += g->start[v + 1];
    }
  }
end:
  orb_free(ctx, twin);
  return status;
}

void orb_distances_free(orb_context *ctx, orb_distances *g) {
  orb_free(ctx, g->start);
  orb_free(ctx, g->link);
  orb_free(ctx, g->heap);
}

static void push(orb_distances *g, double distance, int32_t vertex) {
  int64_t i = g->heap_count++;
  for (; i > 0 && g->heap[(i - 1) / 2].distance > distance; i = (i - 1) / 2) {
    g->heap[i] = g->heap[(i - 1) / 2];
  }
  g->heap[i] = (orb_heap_item){distance, vertex};
}

static orb_heap_item pop(orb_distances *g) {
  orb_heap_item top = g->heap[0], last = g->heap[--g->heap_count];
  int64_t i = 0;
  for (int64_t child = 1; child < g->heap_count; child = 2 * i + 1) {
    child += child + 1 < g->heap_count && g->heap[child + 1].distance < g->heap[child].distance;
    if (g->heap[child].distance >= last.distance) {
      break;
    }
    g->heap[i] = g->heap[child];
    i = child;
  }
  g->heap[i] = last;
  return top;
}

void orb_distances_from(orb_distances *g, int32_t from, double *out) {
  for (int32_t v = 0; v < g->vertices; v++) {
    out[v] = INFINITY;
  }
  out[from] = 0;
  g->heap_count = 0;
  push(g, 0, from);
  while (g->heap_count > 0) {
    orb_heap_item top = pop(g);
    if (top.distance > out[top.vertex]) {
      continue;
    }
    for (int32_t i = g->start[top.vertex]; i < g->start[top.vertex + 1]; i++) {
      double d = top.distance + g->link[i].length;
      if (d < out[g->link[i].vertex]) {
        out[g->link[i].vertex] = d;
        push(g, d, g->link[i].vertex);
      }
    }
  }
}
