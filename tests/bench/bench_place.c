/* Converts landmarks, as a request names them, to places on the repaired mesh. */
#include <math.h>
#include <stddef.h>

#include "bench.h"

static int place_vertex(orb_context *ctx, const orb_mesh *mesh, int32_t index, orb_place *out, const char **why) {
  int32_t vertex = index >= 0 && index < mesh->file_vertex_count ? mesh->vertex_of_source[index] : -1;
  if (vertex < 0) {
    *why = index >= mesh->file_vertex_count ? "the file has fewer vertices" : "the repair dropped this vertex";
    return 0;
  }
  *why = "out of memory";
  return orb_place_of_vertex(ctx, mesh, vertex, out) == ORB_OK;
}

/* Matches corners by their vertices in the file: the repair may have reversed the triangle. */
static int place_triangle(const bench_mesh *m, const api_place *spot, orb_place *out, const char **why) {
  *why = "the repair dropped or changed this triangle, or the file has fewer";
  int32_t t = 0, taken = 0;
  while (t < m->mesh.triangle_count && m->mesh.source_triangle[t] != spot->index) {
    t++;
  }
  if (t == m->mesh.triangle_count || spot->index >= m->raw_triangle_count) {
    return 0;
  }
  out->triangle = t;
  for (int k = 0; k < 3; k++) {
    int32_t file_vertex = m->raw_corners[3 * spot->index + k];
    int32_t stands = file_vertex >= 0 ? m->mesh.vertex_of_source[file_vertex] : -1;
    for (int corner = 0; corner < 3 && stands >= 0; corner++) {
      int32_t vertex = m->mesh.triangles[3 * t + corner];
      if (!(taken & 1 << corner) && (vertex == stands || m->mesh.source[vertex] == m->mesh.source[stands])) {
        out->at[corner] = spot->at[k];
        taken |= 1 << corner;
        break;
      }
    }
  }
  return taken == 7;
}

int bench_place(orb_context *ctx, const bench_mesh *m, const api_place *spot, orb_nearest **tree, orb_place *out,
                const char **why) {
  switch (spot->kind) {
    case API_PLACE_VERTEX:
      return place_vertex(ctx, &m->mesh, spot->index, out, why);
    case API_PLACE_TRIANGLE:
      return place_triangle(m, spot, out, why);
    case API_PLACE_POINT:
      break;
  }
  *why = "out of memory";
  if (!*tree && orb_nearest_create(ctx, m->mesh.positions, m->mesh.triangles, m->mesh.triangle_count, tree) != ORB_OK) {
    return 0;
  }
  orb_nearest_query(*tree, spot->at, INFINITY, out);
  return 1;
}
