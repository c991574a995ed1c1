/* The locator: a cube map of start triangles for the exact walk.
 *
 * Each of the 6·R² cells of a cube around the sphere holds a triangle near it: that of some vertex in the cell, or of a
 * neighbouring cell that has one. With about four triangles a cell, a walk takes a handful of steps. The result does
 * not depend on where the walk begins: on an edge or at a vertex it is the lowest-numbered triangle that holds p. */
#include "sphere/locate.h"

#include <math.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

struct orb_locator {
  orb_sphere_view mesh;
  int32_t *own_twin;
  int32_t resolution;
  int32_t *cell; /* 6 · resolution²: a start triangle */
};

static int32_t cell_of(const orb_locator *locator, const double p[3]) {
  int axis = 0;
  for (int k = 1; k < 3; k++) {
    axis = fabs(p[k]) > fabs(p[axis]) ? k : axis;
  }
  double major = fabs(p[axis]);
  if (!(major > 0)) {
    return 0;
  }
  int32_t r = locator->resolution;
  int32_t grid[2];
  for (int k = 0; k < 2; k++) {
    double u = 0.5 * r * (1 + p[(axis + 1 + k) % 3] / major);
    grid[k] = u < 0 ? 0 : u >= r ? r - 1 : (int32_t)u;
  }
  int32_t face = 2 * axis + (p[axis] < 0);
  return (face * r + grid[1]) * r + grid[0];
}

static void fill_cells(orb_locator *locator) {
  int32_t cells = 6 * locator->resolution * locator->resolution;
  for (int32_t c = 0; c < cells; c++) {
    locator->cell[c] = -1;
  }
  for (int32_t t = locator->mesh.triangle_count - 1; t >= 0; t--) { /* downwards, so that the lowest triangle stays */
    for (int k = 0; k < 3; k++) {
      locator->cell[cell_of(locator, locator->mesh.points + 3 * (int64_t)locator->mesh.triangles[3 * t + k])] = t;
    }
  }
  int32_t row = locator->resolution, last = 0;
  for (int32_t c = 0; c < cells; c++) { /* an empty cell copies the cell in the row before, or the previous cell */
    if (locator->cell[c] < 0) {
      locator->cell[c] = c >= row ? locator->cell[c - row] : last;
    }
    last = locator->cell[c];
  }
}

orb_status orb_locator_create(orb_context *ctx, const double *points, int32_t vertex_count, const int32_t *triangles,
                              int32_t triangle_count, const int32_t *twin, orb_locator **out) {
  *out = NULL;
  orb_status status = ORB_E_NO_MEMORY;
  orb_locator *locator = ORB_NEW0(ctx, orb_locator, 1);
  if (!locator) {
    return status;
  }
  if (!twin) {
    locator->own_twin = ORB_NEW(ctx, int32_t, 3 * (int64_t)triangle_count);
    if (!locator->own_twin) {
      goto fail;
    }
    ORB_GO(status, orb_mesh_twins(ctx, triangles, triangle_count, vertex_count, locator->own_twin), fail);
    twin = locator->own_twin;
  }
  locator->mesh = (orb_sphere_view){points, triangles, twin, triangle_count};
  locator->resolution = 1;
  while (24.0 * locator->resolution * locator->resolution < triangle_count) {
    locator->resolution++;
  }
  status = ORB_E_NO_MEMORY;
  locator->cell = ORB_NEW(ctx, int32_t, 6 * (int64_t)locator->resolution * locator->resolution);
  if (!locator->cell) {
    goto fail;
  }
  fill_cells(locator);
  *out = locator;
  return ORB_OK;
fail:
  orb_free(ctx, locator->own_twin);
  orb_free(ctx, locator);
  return status;
}

void orb_locator_destroy(orb_context *ctx, orb_locator *locator) {
  if (locator) {
    orb_free(ctx, locator->cell);
    orb_free(ctx, locator->own_twin);
    orb_free(ctx, locator);
  }
}

/* The hit in the lowest-numbered of all triangles that hold its direction. */
static orb_hit lowest(const orb_sphere_view *mesh, const orb_hit *hit) {
  int corner = orb_hit_corner(hit);
  int32_t edge = orb_hit_edge(hit);
  orb_hit best = *hit;
  if (corner >= 0) {
    int32_t first = 3 * hit->triangle + corner, low = first;
    for (int32_t h = mesh->twin[orb_prev(first)]; h != first; h = mesh->twin[orb_prev(h)]) {
      low = h / 3 < low / 3 ? h : low;
    }
    best.triangle = low / 3;
    best.side[0] = best.side[1] = best.side[2] = 0;
    best.side[orb_next(low) % 3] = 1;
  } else if (edge >= 0 && mesh->twin[edge] / 3 < hit->triangle) {
    best.triangle = mesh->twin[edge] / 3;
    best.side[0] = best.side[1] = best.side[2] = 1;
    best.side[mesh->twin[edge] % 3] = 0;
  }
  return best;
}

orb_hit orb_locate_hit(const orb_locator *locator, const double p[3], int32_t hint, orb_place *out) {
  int32_t start = hint >= 0 && hint < locator->mesh.triangle_count ? hint : locator->cell[cell_of(locator, p)];
  orb_hit hit = orb_walk(&locator->mesh, p, start);
  hit = lowest(&locator->mesh, &hit);
  out->triangle = hit.triangle;
  orb_project(&locator->mesh, &hit, p, out->at);
  return hit;
}

void orb_locate(const orb_locator *locator, const double p[3], int32_t hint, orb_place *out) {
  (void)orb_locate_hit(locator, p, hint, out);
}
