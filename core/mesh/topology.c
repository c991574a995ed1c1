/* The topology of any index list. */
#include <string.h>

#include "base/check.h"
#include "base/forest.h"
#include "base/memory.h"
#include "mesh/surface.h"

/* Counts the vertices whose faces form more than one fan. Faces around a vertex are connected over edges of two faces,
 * whether or not these face the same way: a union over the corners of each vertex. */
static orb_status count_fans(orb_surface *s, orb_topology *out, int64_t *used) {
  const orb_mesh *mesh = s->mesh;
  int32_t half_edges = 3 * mesh->triangle_count;
  int32_t *root = ORB_NEW(s->ctx, int32_t, half_edges);
  int32_t *fans = ORB_NEW0(s->ctx, int32_t, mesh->vertex_count);
  if (!root || !fans) {
    orb_free(s->ctx, root);
    orb_free(s->ctx, fans);
    return ORB_E_NO_MEMORY;
  }
  orb_forest_plant(root, half_edges);
  for (int32_t h = 0; h < half_edges; h++) {
    int32_t g = s->twin[h];
    if (g <= h) {
      continue;
    }
    for (int end = 0; end < 2; end++) {
      int32_t a = end ? orb_next(h) : h;
      int32_t b = mesh->triangles[g] == mesh->triangles[a] ? g : orb_next(g);
      orb_forest_join(root, a, b);
    }
  }
  for (int32_t h = 0; h < half_edges; h++) {
    fans[mesh->triangles[h]] += root[h] == h;
  }
  for (int32_t v = 0; v < mesh->vertex_count; v++) {
    *used += fans[v] > 0;
    out->nonmanifold_vertices += fans[v] > 1;
  }
  orb_free(s->ctx, root);
  orb_free(s->ctx, fans);
  return ORB_OK;
}

/* Counts boundary loops without a consistent orientation: as components of the boundary. Loops that meet at a vertex of
 * several fans count as one. */
static orb_status count_loops(orb_surface *s, int64_t *loops) {
  const orb_mesh *mesh = s->mesh;
  int32_t *root = ORB_NEW(s->ctx, int32_t, mesh->vertex_count);
  if (!root) {
    return ORB_E_NO_MEMORY;
  }
  memset(root, 0xff, (size_t)mesh->vertex_count * sizeof *root);
  int64_t vertices = 0, joins = 0;
  for (int32_t h = 0; h < 3 * mesh->triangle_count; h++) {
    if (s->twin[h] != ORB_OPEN) {
      continue;
    }
    const int32_t end[2] = {mesh->triangles[h], mesh->triangles[orb_next(h)]};
    for (int i = 0; i < 2; i++) {
      if (root[end[i]] < 0) {
        root[end[i]] = end[i];
        vertices++;
      }
    }
    joins += orb_forest_join(root, end[0], end[1]);
  }
  *loops = vertices - joins;
  orb_free(s->ctx, root);
  return ORB_OK;
}

orb_status orb_mesh_topology(orb_context *ctx, const orb_mesh *mesh, orb_topology *out) {
  memset(out, 0, sizeof *out);
  orb_mesh view = *mesh;
  orb_surface s = {0};
  int64_t used = 0;
  orb_status status = orb_surface_open(ctx, &view, &s);
  if (status == ORB_OK) {
    status = orb_surface_pieces(&s);
  }
  if (status == ORB_OK) {
    status = count_fans(&s, out, &used);
  }
  if (status == ORB_OK) {
    status = s.edges.same_way == 0 && s.edges.crowded == 0 ? orb_surface_loops(&s, &out->boundary_loops)
                                                           : count_loops(&s, &out->boundary_loops);
  }
  if (status == ORB_OK) {
    out->components = s.piece_count;
    out->boundary_edges = s.edges.open;
    out->nonmanifold_edges = s.edges.crowded;
    out->consistent = s.edges.same_way == 0;
    out->orientable = s.conflict < 0;
    out->genus =
        0.5 * (double)(2 * out->components - used + s.edges.edges - mesh->triangle_count - out->boundary_loops);
  }
  s.ctx = ctx;
  orb_surface_close(&s);
  return status;
}
