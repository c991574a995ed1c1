#include "align/map/rims/side.h"

#include <math.h>
#include <string.h>

#include "base/check.h"
#include "base/memory.h"
#include "numeric/vec3.h"

/* The vertex at which half-edge i of the rims begins. */
static int32_t rim_vertex(const orb_rim_side *side, int32_t i) {
  return side->shape->mesh.triangles[side->holes.half_edges[i]];
}

static const double *point_of(const orb_rim_side *side, int32_t i) {
  return side->shape->mesh.positions + 3 * (size_t)rim_vertex(side, i);
}

double orb_rim_nearest(const orb_rim_side *side, const orb_hole *hole, const double p[3], double *distance) {
  double least = INFINITY, where = 0;
  for (int32_t k = 0; k < hole->count; k++) {
    const int32_t i = hole->start + k, next = hole->start + (k + 1) % hole->count;
    const double *a = point_of(side, i), *b = point_of(side, next);
    double edge[3], to[3], off[3];
    orb_sub(b, a, edge);
    orb_sub(p, a, to);
    const double length2 = orb_dot(edge, edge);
    const double t = length2 > 0 ? fmin(fmax(orb_dot(to, edge) / length2, 0), 1) : 0;
    for (int c = 0; c < 3; c++) {
      off[c] = to[c] - t * edge[c];
    }
    const double d = orb_dot(off, off);
    if (d < least) {
      least = d;
      where = side->holes.at[i] + t * sqrt(length2);
    }
  }
  *distance = sqrt(least);
  return hole->length > 0 ? where / hole->length : 0;
}

static orb_status side_create(orb_context *ctx, const orb_aligned_shape *shape, orb_rim_side *out) {
  orb_extent extent;
  orb_mesh_extent(&shape->mesh, &extent);
  out->shape = shape;
  out->diagonal = extent.diagonal;
  ORB_TRY(orb_holes_find(ctx, &shape->mesh, &out->holes));
  return orb_locator_create(ctx, shape->points, shape->mesh.vertex_count, shape->mesh.triangles,
                            shape->mesh.triangle_count, NULL, &out->locator);
}

static int32_t rim_edges(const orb_hole_list *holes) {
  return holes->count > 0 ? holes->of[holes->count - 1].start + holes->of[holes->count - 1].count : 0;
}

/* Takes the rims of one side to the other shape. */
static orb_status take_over(orb_context *ctx, orb_rim_side *from, const orb_rim_side *to) {
  const int32_t count = rim_edges(&from->holes);
  int32_t hint = -1;
  from->image = ORB_NEW(ctx, double, 3 * (size_t)count);
  if (!from->image) {
    return ORB_E_NO_MEMORY;
  }
  for (int32_t i = 0; i < count; i++) {
    orb_place place;
    orb_locate(to->locator, from->shape->points + 3 * (size_t)rim_vertex(from, i), hint, &place);
    orb_place_position(&to->shape->mesh, &place, from->image + 3 * (size_t)i);
    hint = place.triangle;
  }
  return ORB_OK;
}

orb_status orb_rim_sides_create(orb_context *ctx, const orb_aligned_shape *first, const orb_aligned_shape *second,
                                orb_rim_side sides[2]) {
  memset(sides, 0, 2 * sizeof *sides);
  ORB_TRY(side_create(ctx, first, &sides[0]));
  ORB_TRY(side_create(ctx, second, &sides[1]));
  ORB_TRY(take_over(ctx, &sides[0], &sides[1]));
  return take_over(ctx, &sides[1], &sides[0]);
}

void orb_rim_sides_free(orb_context *ctx, orb_rim_side sides[2]) {
  for (int s = 0; s < 2; s++) {
    orb_holes_free(ctx, &sides[s].holes);
    orb_locator_destroy(ctx, sides[s].locator);
    orb_free(ctx, sides[s].image);
    sides[s].locator = NULL;
    sides[s].image = NULL;
  }
}
