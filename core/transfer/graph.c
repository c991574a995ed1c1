#include "transfer/graph.h"

#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* Both in units of the mean of twice a triangle's area on a. The first keeps the weights of triangles without area
 * positive, so that the system stays regular, and is far below what counts. The second bounds the weight of an edge
 * without length: edges below a thirtieth of the usual length weigh no more than that. */
static const double LEAST_AREA = 1e-9, LEAST_LENGTH2 = 1e-3;

double orb_twice_area(const double *positions, const int32_t corner[3]) {
  double u[3], w[3], n[3];
  orb_sub(positions + 3 * (int64_t)corner[1], positions + 3 * (int64_t)corner[0], u);
  orb_sub(positions + 3 * (int64_t)corner[2], positions + 3 * (int64_t)corner[0], w);
  orb_cross(u, w, n);
  return orb_length(n);
}

static double total_area(const double *positions, const int32_t *triangles, int32_t count) {
  double sum = 0;
  for (int32_t t = 0; t < count; t++) {
    sum += orb_twice_area(positions, triangles + 3 * (int64_t)t);
  }
  return sum;
}

/* Each neighbour once: the vertex that follows v in each triangle of v. */
static orb_status list_neighbors(orb_context *ctx, orb_edge_graph *graph, const int32_t *triangles,
                                 int32_t triangle_count) {
  int32_t n = graph->vertex_count;
  int64_t corners = 3 * (int64_t)triangle_count;
  graph->first = ORB_NEW0(ctx, int32_t, (int64_t)n + 1);
  graph->neighbor = ORB_NEW(ctx, int32_t, corners);
  graph->weight = ORB_NEW0(ctx, double, corners);
  graph->diagonal = ORB_NEW0(ctx, double, n);
  if (!graph->first || !graph->neighbor || !graph->weight || !graph->diagonal) {
    return ORB_E_NO_MEMORY;
  }
  for (int64_t h = 0; h < corners; h++) {
    graph->first[triangles[h] + 1]++;
  }
  for (int32_t v = 0; v < n; v++) {
    graph->first[v + 1] += graph->first[v];
  }
  for (int64_t h = 0; h < corners; h++) { /* diagonal counts the entries so far */
    int32_t v = triangles[h], next = triangles[h % 3 == 2 ? h - 2 : h + 1];
    graph->neighbor[graph->first[v] + (int32_t)graph->diagonal[v]] = next;
    graph->diagonal[v] += 1;
  }
  return ORB_OK;
}

static int32_t entry_of(const orb_edge_graph *graph, int32_t v, int32_t neighbor) {
  for (int32_t i = graph->first[v]; i < graph->first[v + 1]; i++) {
    if (graph->neighbor[i] == neighbor) {
      return i;
    }
  }
  ORB_ASSERT(0 && "the triangles are closed");
  return -1;
}

/* Half the weight of an edge comes from each of its triangles, that is from each of its half-edges. */
static void make_weights(orb_edge_graph *graph, const double *a, const double *b, const int32_t *triangles,
                         int32_t triangle_count) {
  double area_a = total_area(a, triangles, triangle_count);
  double area_b = total_area(b, triangles, triangle_count);
  double scale = area_a > 0 && area_b > 0 ? area_a / area_b : 1, mean = area_a / triangle_count;
  for (int64_t h = 0; h < 3 * (int64_t)triangle_count; h++) {
    const int32_t *corner = triangles + 3 * (h / 3);
    int32_t v = triangles[h], next = triangles[h % 3 == 2 ? h - 2 : h + 1];
    double area = orb_twice_area(a, corner) + scale * orb_twice_area(b, corner);
    double length2 = orb_distance2(a + 3 * (int64_t)v, a + 3 * (int64_t)next) +
                     scale * orb_distance2(b + 3 * (int64_t)v, b + 3 * (int64_t)next);
    double weight = (area + LEAST_AREA * mean) / (length2 + LEAST_LENGTH2 * mean);
    graph->weight[entry_of(graph, v, next)] += weight;
    graph->weight[entry_of(graph, next, v)] += weight;
  }
  for (int32_t v = 0; v < graph->vertex_count; v++) {
    graph->diagonal[v] = 0;
    for (int32_t i = graph->first[v]; i < graph->first[v + 1]; i++) {
      graph->diagonal[v] += graph->weight[i];
    }
  }
}

orb_status orb_edge_graph_make(orb_context *ctx, const double *a, const double *b, int32_t vertex_count,
                               const int32_t *triangles, int32_t triangle_count, orb_edge_graph *out) {
  *out = (orb_edge_graph){.vertex_count = vertex_count};
  orb_status status = list_neighbors(ctx, out, triangles, triangle_count);
  if (status == ORB_OK) {
    make_weights(out, a, b, triangles, triangle_count);
    status = orb_context_check(ctx);
  }
  if (status != ORB_OK) {
    orb_edge_graph_free(ctx, out);
  }
  return status;
}

void orb_edge_graph_free(orb_context *ctx, orb_edge_graph *graph) {
  orb_free(ctx, graph->first);
  orb_free(ctx, graph->neighbor);
  orb_free(ctx, graph->weight);
  orb_free(ctx, graph->diagonal);
  memset(graph, 0, sizeof *graph);
}
