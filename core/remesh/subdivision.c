/* The subdivision method (Peng & Timalsena 2016, section 8), made conforming.
 *
 * The quadtree gives a balanced, closed triangulation of the sphere whose leaves hold at most one vertex of each shape.
 * Then every vertex of every shape becomes a vertex of it: a corner of the leaf moves there if that flips no triangle
 * and the corner has not moved before, else the triangle is split. Delaunay flips make the triangles more even, and
 * edges that deviate from a shape are flipped or split (placed/refine.h). */
#include "remesh/common/job.h"

#include "base/check.h"
#include "base/context.h"
#include "base/memory.h"
#include "numeric/vec3.h"
#include "remesh/placed/export.h"
#include "remesh/placed/refine.h"
#include "remesh/quadtree.h"
#include "sphere/delaunay.h"

/* Relative to the diagonal. Reproduction must be within half a per cent; the proved bound is kept below that. */
static const double MOST_ERROR = 0.004;
/* A corner moves to a vertex only if that is nearer than half the triangle's shortest edge: farther moves would distort
 * the quadtree's triangles more. */
static const double SNAP2 = 0.25; /* squared */
enum { CHECK_EVERY = 4096 };      /* vertices between two checks for cancellation */

/* Moves to p the nearest corner of its triangle that is not taken, if that leaves every triangle positive. Returns the
 * corner, or −1. */
static int32_t snap(orb_net *net, const unsigned char *taken, int32_t grid_count, int32_t triangle, const double p[3]) {
  int32_t best = -1;
  double best_distance = 0, shortest = 4;
  for (int k = 0; k < 3; k++) {
    int32_t v = net->triangles[3 * triangle + k], w = net->triangles[3 * triangle + (k + 1) % 3];
    double distance = orb_distance2(p, orb_net_point(net, v));
    double edge = orb_distance2(orb_net_point(net, v), orb_net_point(net, w));
    shortest = edge < shortest ? edge : shortest;
    if (v < grid_count && !taken[v] && (best < 0 || distance < best_distance)) {
      best = v;
      best_distance = distance;
    }
  }
  return best >= 0 && best_distance < SNAP2 * shortest && orb_net_move(net, best, p) ? best : -1;
}

static orb_status take_in_vertices(orb_context *ctx, const orb_remesh_job *job, const orb_quadtree_mesh *grid,
                                   orb_net *net) {
  unsigned char *taken = ORB_NEW0(ctx, unsigned char, grid->vertex_count);
  if (!taken) {
    return ORB_E_NO_MEMORY;
  }
  orb_status status = ORB_OK;
  for (int32_t i = 0; i < grid->item_count && status == ORB_OK; i++) {
    const orb_quadtree_item *item = &grid->items[i];
    const double *p = job->shapes[item->shape].points + 3 * (int64_t)item->vertex;
    orb_sphere_view view = orb_net_view(net);
    orb_hit hit = orb_walk(&view, p, item->triangle);
    int corner = orb_hit_corner(&hit);
    int32_t v =
        corner >= 0 ? net->triangles[3 * hit.triangle + corner] : snap(net, taken, grid->vertex_count, hit.triangle, p);
    if (v < 0) {
      int32_t start = hit.triangle;
      v = orb_net_insert(net, p, &start);
    }
    if (v < grid->vertex_count) {
      taken[v] = 1;
    }
    if (i % CHECK_EVERY == 0) {
      status = orb_context_check(ctx);
      orb_progress(ctx, "remesh", 0.3 + 0.4 * i / grid->item_count);
    }
  }
  orb_free(ctx, taken);
  return status;
}

orb_status orb_remesh_subdivision(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out) {
  orb_quadtree_mesh grid;
  orb_net net = {0};
  ORB_TRY(orb_quadtree_build(ctx, job, &grid));
  orb_status status = orb_net_init(ctx, &net, grid.points, grid.vertex_count, grid.triangles, grid.triangle_count, NULL,
                                   (int64_t)grid.vertex_count + grid.item_count);
  if (status == ORB_OK) {
    status = take_in_vertices(ctx, job, &grid, &net);
  }
  orb_quadtree_free(ctx, &grid);
  if (status == ORB_OK) {
    status = orb_net_delaunay(ctx, &net);
  }
  orb_placed_net placed = {0};
  if (status == ORB_OK) {
    status = orb_placed_create_on(ctx, job, &net, &placed);
  }
  orb_net_free(ctx, &net);
  if (status == ORB_OK) {
    status = orb_placed_refine(ctx, &placed, MOST_ERROR * MOST_ERROR, NULL);
  }
  if (status == ORB_OK) {
    status = orb_placed_export(ctx, &placed, out);
  }
  orb_placed_free(ctx, &placed);
  return status;
}
