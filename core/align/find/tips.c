/* Tips of limbs by distances along the surface.
 *
 * The mean distance of a point from the rest of the surface is greatest at the tips of limbs (the integral geodesic of
 * Hilaga et al. 2001, as Zhang et al. 2005 use it). Distances are those of shortest paths over edges and, across each
 * edge, between the two opposite vertices, which makes them nearly independent of the triangulation. A few sources,
 * spread by farthest points, represent all points.
 */
#include "align/find/tips.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* All chosen by trial on the `auto` rows of docs/bench-truth.md. Lengths are along the surface, in units of the mean
 * distance of two points of it. */
enum { SOURCES = 64 };             /* points from which distances are averaged; each costs one search of the mesh */
static const double APART = 0.2;   /* tips nearer to each other count as one */
static const double FARTHER = 1.1; /* least mean distance of a tip: a ball, where it is 1 everywhere, has no tips */

typedef struct link_to {
  int32_t vertex;
  double length;
} link_to;

typedef struct heap_item {
  double distance;
  int32_t vertex;
} heap_item;

typedef struct graph {
  orb_context *ctx;
  int32_t vertices;
  int32_t *start;
  link_to *link;
  heap_item *heap;
  int64_t heap_count;
} graph;

static void graph_free(graph *g) {
  orb_free(g->ctx, g->start);
  orb_free(g->ctx, g->link);
  orb_free(g->ctx, g->heap);
}

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

static orb_status graph_create(orb_context *ctx, const orb_mesh *mesh, graph *g) {
  orb_status status = ORB_OK;
  int32_t half_edges = 3 * mesh->triangle_count, *twin = ORB_NEW(ctx, int32_t, half_edges);
  g->ctx = ctx;
  g->vertices = mesh->vertex_count;
  g->start = ORB_NEW0(ctx, int32_t, mesh->vertex_count + 2);
  g->link = ORB_NEW(ctx, link_to, 2 * (size_t)half_edges);
  g->heap = ORB_NEW(ctx, heap_item, 2 * (size_t)half_edges + 1);
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
      g->link[fill[a]++] = (link_to){b, sqrt(orb_distance2(pa, pb))};
      g->link[fill[c]++] = (link_to){d, across(pa, pb, x + 3 * (size_t)c, x + 3 * (size_t)d)};
    }
    for (int32_t v = 0; v < mesh->vertex_count && !pass; v++) {
      g->start[v + 2] += g->start[v + 1];
    }
  }
end:
  orb_free(ctx, twin);
  return status;
}

static void push(graph *g, double distance, int32_t vertex) {
  int64_t i = g->heap_count++;
  for (; i > 0 && g->heap[(i - 1) / 2].distance > distance; i = (i - 1) / 2) {
    g->heap[i] = g->heap[(i - 1) / 2];
  }
  g->heap[i] = (heap_item){distance, vertex};
}

static heap_item pop(graph *g) {
  heap_item top = g->heap[0], last = g->heap[--g->heap_count];
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

/* Distances from one vertex to all (Dijkstra 1959). */
static void distances(graph *g, int32_t from, double *out) {
  for (int32_t v = 0; v < g->vertices; v++) {
    out[v] = INFINITY;
  }
  out[from] = 0;
  g->heap_count = 0;
  push(g, 0, from);
  while (g->heap_count > 0) {
    heap_item top = pop(g);
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

/* The mean distance of every vertex from the sources; *mean: over all vertices. buffer: two doubles a vertex. */
static orb_status mean_distances(graph *g, double *far, double *buffer, double *mean) {
  double *one = buffer, *nearest = buffer + g->vertices;
  int32_t source = 0;
  for (int32_t v = 0; v < g->vertices; v++) {
    far[v] = 0;
    nearest[v] = INFINITY;
  }
  for (int i = -1; i < SOURCES; i++) { /* round −1 only finds the first source */
    distances(g, source, one);
    int32_t next = 0;
    for (int32_t v = 0; v < g->vertices; v++) {
      far[v] += i < 0 ? 0 : one[v] / SOURCES;
      nearest[v] = i < 1 || one[v] < nearest[v] ? one[v] : nearest[v];
      next = nearest[v] > nearest[next] ? v : next;
    }
    source = next;
    ORB_TRY(orb_context_check(g->ctx));
  }
  *mean = 0;
  for (int32_t v = 0; v < g->vertices; v++) {
    *mean += far[v] / g->vertices;
  }
  return ORB_OK;
}

static int is_peak(const graph *g, const double *far, int32_t v) {
  for (int32_t i = g->start[v]; i < g->start[v + 1]; i++) {
    int32_t u = g->link[i].vertex;
    if (far[u] > far[v] || (far[u] == far[v] && u < v)) {
      return 0;
    }
  }
  return 1;
}

/* The farthest peak that is beyond `least` and not near another tip; −1: none. */
static int32_t next_peak(const graph *g, const double *far, const unsigned char *near, double least) {
  int32_t best = -1;
  for (int32_t v = 0; v < g->vertices; v++) {
    if (!near[v] && far[v] > least && (best < 0 || far[v] > far[best]) && is_peak(g, far, v)) {
      best = v;
    }
  }
  return best;
}

static orb_status find(graph *g, double *buffer, unsigned char *near, orb_tips *out) {
  double *far = buffer, *one = buffer + g->vertices, mean;
  ORB_TRY(mean_distances(g, far, one, &mean));
  for (int32_t v; out->count < ORB_TIPS_MAX && (v = next_peak(g, far, near, FARTHER * mean)) >= 0;) {
    int is_highest = 1;
    distances(g, v, one);
    for (int32_t u = 0; u < g->vertices; u++) {
      if (one[u] < APART * mean) {
        near[u] = 1;
        is_highest = is_highest && far[u] <= far[v];
      }
    }
    if (is_highest) {
      int32_t k = out->count++;
      out->vertex[k] = v;
      out->far[k] = far[v] / mean;
      for (int32_t i = 0; i <= k; i++) {
        out->distance[i][k] = out->distance[k][i] = one[out->vertex[i]] / mean;
      }
    }
    ORB_TRY(orb_context_check(g->ctx));
  }
  return ORB_OK;
}

orb_status orb_tips_find(orb_context *ctx, const orb_mesh *mesh, orb_tips *out) {
  orb_status status;
  graph g = {.ctx = ctx};
  double *buffer = ORB_NEW(ctx, double, 3 * (size_t)mesh->vertex_count);
  unsigned char *near = ORB_NEW0(ctx, unsigned char, mesh->vertex_count);
  memset(out, 0, sizeof *out);
  if (!buffer || !near) {
    status = ORB_E_NO_MEMORY;
    goto end;
  }
  ORB_GO(status, graph_create(ctx, mesh, &g), end);
  status = find(&g, buffer, near, out);
end:
  graph_free(&g);
  orb_free(ctx, buffer);
  orb_free(ctx, near);
  return status;
}
