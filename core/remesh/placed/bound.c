#include "remesh/placed/bound.h"

#include <math.h>

#include "base/memory.h"
#include "base/parallel.h"
#include "numeric/vec3.h"
#include "remesh/placed/distance.h"

static const double *shape_vertex(const orb_placed_net *placed, int32_t s, int32_t h) {
  return placed->position[s] + 3 * (int64_t)placed->view[s].triangles[h];
}

/* orb_placed_edge2() on shape s alone. */
static double edge_on2(const orb_placed_net *placed, int32_t s, int32_t v, int32_t w, double limit2,
                       orb_deviation *worst) {
  double greatest = 0;
  const double *a = orb_placed_position(placed, v, s), *b = orb_placed_position(placed, w, s);
  orb_spot from = placed->spot[(int64_t)v * placed->shape_count + s],
           to = placed->spot[(int64_t)w * placed->shape_count + s];
  if (from.kind == ORB_SPOT_FACE && to.kind == ORB_SPOT_FACE && from.h / 3 == to.h / 3) {
    return 0; /* within one triangle */
  }
  orb_arc_tracer tracer;
  orb_crossing crossing;
  orb_trace_between(&tracer, &placed->view[s], from, orb_net_point(&placed->net, v), to,
                    orb_net_point(&placed->net, w));
  while (greatest <= limit2 && orb_trace_next(&tracer, &crossing)) {
    const double *c = shape_vertex(placed, s, crossing.h);
    double distance2 = crossing.at_vertex ? orb_point_segment2(c, a, b)
                                          : orb_segments2(a, b, c, shape_vertex(placed, s, orb_next(crossing.h)));
    if (distance2 > greatest) {
      greatest = distance2;
      if (worst && distance2 > worst->distance2) {
        *worst = (orb_deviation){distance2, s, crossing.h, crossing.at_vertex};
      }
    }
  }
  return greatest;
}

double orb_placed_edge2(const orb_placed_net *placed, int32_t v, int32_t w, double limit2, orb_deviation *worst) {
  double greatest = 0;
  for (int32_t s = 0; s < placed->shape_count && greatest <= limit2; s++) {
    double distance2 = edge_on2(placed, s, v, w, limit2, worst);
    greatest = distance2 > greatest ? distance2 : greatest;
  }
  return greatest;
}

void orb_placed_crossing_point(const orb_placed_net *placed, int32_t v, int32_t w, const orb_deviation *at,
                               double out[3]) {
  const orb_sphere_view *view = &placed->view[at->shape];
  const double *c = view->points + 3 * (int64_t)view->triangles[at->h];
  if (at->at_vertex) {
    out[0] = c[0];
    out[1] = c[1];
    out[2] = c[2];
    return;
  }
  const double *d = view->points + 3 * (int64_t)view->triangles[orb_next(at->h)];
  const double *p = orb_net_point(&placed->net, v), *q = orb_net_point(&placed->net, w);
  /* the plane of p q cuts c d in proportion to the distances of c and d from that plane */
  double wc = fabs(orb_det(p, q, c)), wd = fabs(orb_det(p, q, d)), sum = wc + wd;
  double t = sum > 0 ? wc / sum : 0.5;
  for (int k = 0; k < 3; k++) {
    out[k] = (1 - t) * c[k] + t * d[k];
  }
  (void)orb_normalize(out);
}

double orb_placed_item2(const orb_placed_net *placed, int32_t item, int32_t a, int32_t b, int32_t c) {
  int32_t s = placed->item_shape[item];
  return orb_point_triangle2(orb_placed_item_position(placed, item), orb_placed_position(placed, a, s),
                             orb_placed_position(placed, b, s), orb_placed_position(placed, c, s));
}

/* Rounding of the places, relative to the distance, and of the distances, relative to the diagonal. */
static const double PLACE_ROUNDING = 1e-12, DISTANCE_ROUNDING = 1e-13;
enum { GRAIN = 512 }; /* triangles a thread takes at a time */

typedef struct bound_loop {
  const orb_placed_net *placed;
  double *greatest; /* per chunk of GRAIN triangles, one per shape */
} bound_loop;

static void bound_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  bound_loop *loop = arg;
  const orb_placed_net *placed = loop->placed;
  const orb_net *net = &placed->net;
  double *greatest = loop->greatest + begin / GRAIN * placed->shape_count;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *c = net->triangles + 3 * t;
    if (c[0] < 0) {
      continue;
    }
    for (int32_t i = placed->triangle_items[t]; i >= 0; i = placed->item_next[i]) {
      greatest[placed->item_shape[i]] =
          fmax(greatest[placed->item_shape[i]], orb_placed_item2(placed, i, c[0], c[1], c[2]));
    }
    for (int k = 0; k < 3; k++) {
      for (int32_t s = 0; s < placed->shape_count && c[k] < c[(k + 1) % 3]; s++) {
        greatest[s] = fmax(greatest[s], edge_on2(placed, s, c[k], c[(k + 1) % 3], INFINITY, NULL));
      }
    }
  }
}

orb_status orb_placed_bounds(orb_context *ctx, const orb_placed_net *placed, double *bound) {
  int64_t chunks = ((int64_t)placed->net.triangle_count + GRAIN - 1) / GRAIN;
  bound_loop loop = {placed, ORB_NEW0(ctx, double, chunks * placed->shape_count)};
  if (!loop.greatest) {
    return ORB_E_NO_MEMORY;
  }
  orb_parallel_for(ctx, placed->net.triangle_count, GRAIN, bound_range, &loop);
  for (int32_t s = 0; s < placed->shape_count; s++) {
    double greatest = 0;
    for (int64_t i = 0; i < chunks; i++) {
      greatest = fmax(greatest, loop.greatest[i * placed->shape_count + s]);
    }
    bound[s] = placed->job->diagonal[s] * (sqrt(greatest) * (1 + PLACE_ROUNDING) + DISTANCE_ROUNDING);
  }
  orb_free(ctx, loop.greatest);
  return orb_context_check(ctx);
}
