#include "align/find/inset/grid.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "mesh/nearest.h"
#include "numeric/vec3.h"

double orb_inset_nearest(const orb_mesh *mesh, const orb_nearest *tree, const double p[3], orb_place *near,
                         double at[3], double normal[3]) {
  orb_place place;
  double known = INFINITY;
  if (near->triangle >= 0) {
    double corners[9];
    for (int k = 0; k < 9; k++) {
      const int32_t v = mesh->triangles[3 * (size_t)near->triangle + (size_t)(k / 3)];
      corners[k] = mesh->positions[3 * (size_t)v + (size_t)(k % 3)];
    }
    known = orb_triangle_nearest(corners, p, near->at);
  }
  const double distance2 = orb_nearest_query_from(tree, p, near, known, &place);
  *near = place;
  orb_triangle_normal_at(mesh->positions, mesh->triangles + 3 * (size_t)place.triangle, normal);
  orb_normalize(normal);
  orb_place_position(mesh, &place, at);
  return sqrt(distance2);
}

static void node_at(const orb_inset_grid *g, size_t node, double p[3]) {
  const size_t width = (size_t)g->count[0], area = width * (size_t)g->count[1];
  const size_t at[3] = {node % width, node % area / width, node / area};
  for (int k = 0; k < 3; k++) {
    p[k] = g->low[k] + g->step * (double)at[k];
  }
}

static size_t node_count(const orb_inset_grid *g) {
  return (size_t)g->count[0] * (size_t)g->count[1] * (size_t)g->count[2];
}

/* Lays nodes over the box of a mesh and half a step around it. */
static void lay(const orb_mesh *mesh, int32_t nodes, orb_inset_grid *g) {
  orb_extent extent;
  double longest = 0;
  orb_mesh_extent(mesh, &extent);
  for (int k = 0; k < 3; k++) {
    longest = fmax(longest, extent.max[k] - extent.min[k]);
  }
  g->step = longest / (nodes - 2);
  for (int k = 0; k < 3; k++) {
    g->low[k] = extent.min[k] - g->step / 2;
    g->count[k] = (int32_t)ceil((extent.max[k] - g->low[k]) / g->step) + 1;
  }
}

orb_status orb_inset_grid_create(orb_context *ctx, const orb_mesh *large, const orb_nearest *tree, orb_inset_grid *g) {
  memset(g, 0, sizeof *g);
  lay(large, ORB_FIND_INSET_NODES, g);
  const size_t count = node_count(g);
  g->node = ORB_NEW(ctx, float, ORB_INSET_NUMBERS *count);
  if (!g->node) {
    return ORB_E_NO_MEMORY;
  }
  orb_place near = {.triangle = -1};
  for (size_t i = 0; i < count; i++) {
    double p[3], at[3], normal[3];
    float *node = g->node + ORB_INSET_NUMBERS * i;
    node_at(g, i, p);
    node[0] = (float)orb_inset_nearest(large, tree, p, &near, at, normal);
    for (int k = 0; k < 3; k++) {
      node[1 + k] = (float)at[k];
      node[4 + k] = (float)normal[k];
    }
  }
  return orb_context_check(ctx);
}

void orb_inset_grid_free(orb_context *ctx, orb_inset_grid *g) {
  orb_free(ctx, g->node);
  memset(g, 0, sizeof *g);
}

/* The node nearest to a point, or NULL if the point is outside. */
static const float *node_near(const orb_inset_grid *g, const double p[3]) {
  size_t node = 0;
  for (int k = 2; k >= 0; k--) {
    const double at = (p[k] - g->low[k]) / g->step + 0.5;
    if (!(at >= 0 && at < g->count[k])) {
      return NULL;
    }
    node = node * (size_t)g->count[k] + (size_t)at;
  }
  return g->node + ORB_INSET_NUMBERS * node;
}

double orb_inset_grid_foot(const orb_inset_grid *g, const double p[3], double at[3], double normal[3]) {
  const float *node = node_near(g, p);
  if (!node) {
    return INFINITY;
  }
  double above = 0;
  for (int k = 0; k < 3; k++) {
    normal[k] = (double)node[4 + k];
    above += normal[k] * (p[k] - (double)node[1 + k]);
  }
  for (int k = 0; k < 3; k++) {
    at[k] = p[k] - above * normal[k];
  }
  return fabs(above);
}
