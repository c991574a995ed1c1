/* The matched distances of a match: along edges, at items, and over all. */
#include <math.h>

#include "remesh/adaptive/match.h"
#include "remesh/distance.h"

static const double *shape_vertex(const orb_match *match, int32_t s, int32_t h) {
  return match->position[s] + 3 * (int64_t)match->view[s].triangles[h];
}

double orb_match_edge_of_shape2(const orb_match *match, int32_t s, int32_t v, int32_t w, double limit2,
                                orb_stray *worst) {
  double greatest = 0;
  const double *a = orb_match_at(match, v, s), *b = orb_match_at(match, w, s);
  orb_spot from = match->spot[(int64_t)v * match->shape_count + s],
           to = match->spot[(int64_t)w * match->shape_count + s];
  if (from.kind == ORB_SPOT_FACE && to.kind == ORB_SPOT_FACE && from.h / 3 == to.h / 3) {
    return 0; /* within one triangle */
  }
  orb_arc_tracer tracer;
  orb_crossing crossing;
  orb_trace_between(&tracer, &match->view[s], from, orb_net_point(&match->net, v), to, orb_net_point(&match->net, w));
  while (greatest <= limit2 && orb_trace_next(&tracer, &crossing)) {
    const double *c = shape_vertex(match, s, crossing.h);
    double distance2 = crossing.at_vertex ? orb_point_segment2(c, a, b)
                                          : orb_segments2(a, b, c, shape_vertex(match, s, orb_next(crossing.h)));
    if (distance2 > greatest) {
      greatest = distance2;
      if (worst && distance2 > worst->distance2) {
        *worst = (orb_stray){distance2, s, crossing.h, crossing.at_vertex};
      }
    }
  }
  return greatest;
}

double orb_match_edge2(const orb_match *match, int32_t v, int32_t w, double limit2, orb_stray *worst) {
  double greatest = 0;
  for (int32_t s = 0; s < match->shape_count && greatest <= limit2; s++) {
    double distance2 = orb_match_edge_of_shape2(match, s, v, w, limit2, worst);
    greatest = distance2 > greatest ? distance2 : greatest;
  }
  return greatest;
}

double orb_match_item2(const orb_match *match, int32_t item, int32_t a, int32_t b, int32_t c) {
  int32_t s = match->item_shape[item];
  return orb_point_triangle2(orb_match_item_position(match, item), orb_match_at(match, a, s), orb_match_at(match, b, s),
                             orb_match_at(match, c, s));
}

enum { GRAIN = 512 };

typedef struct bound_loop {
  const orb_match *match;
  double *greatest; /* chunk major, a shape */
} bound_loop;

static void bound_range(void *arg, int64_t begin, int64_t end, int thread) {
  (void)thread;
  bound_loop *loop = arg;
  const orb_match *match = loop->match;
  const orb_net *net = &match->net;
  double *greatest = loop->greatest + begin / GRAIN * match->shape_count;
  for (int64_t t = begin; t < end; t++) {
    const int32_t *c = net->triangles + 3 * t;
    if (c[0] < 0) {
      continue;
    }
    for (int32_t i = match->triangle_items[t]; i >= 0; i = match->item_next[i]) {
      greatest[match->item_shape[i]] =
          fmax(greatest[match->item_shape[i]], orb_match_item2(match, i, c[0], c[1], c[2]));
    }
    for (int k = 0; k < 3; k++) {
      for (int32_t s = 0; s < match->shape_count && c[k] < c[(k + 1) % 3]; s++) {
        greatest[s] = fmax(greatest[s], orb_match_edge_of_shape2(match, s, c[k], c[(k + 1) % 3], INFINITY, NULL));
      }
    }
  }
}

orb_status orb_match_bounds(orb_context *ctx, const orb_match *match, double *bound) {
  int64_t chunks = ((int64_t)match->net.triangle_count + GRAIN - 1) / GRAIN;
  bound_loop loop = {match, ORB_NEW0(ctx, double, chunks * match->shape_count)};
  if (!loop.greatest) {
    return ORB_E_NO_MEMORY;
  }
  orb_parallel_for(ctx, match->net.triangle_count, GRAIN, bound_range, &loop);
  for (int32_t s = 0; s < match->shape_count; s++) {
    double greatest = 0;
    for (int64_t i = 0; i < chunks; i++) {
      greatest = fmax(greatest, loop.greatest[i * match->shape_count + s]);
    }
    /* the allowance covers rounding of the places and of the distances themselves */
    bound[s] = match->job->diagonal[s] * (sqrt(greatest) * (1 + 1e-12) + 1e-13);
  }
  orb_free(ctx, loop.greatest);
  return orb_context_check(ctx);
}
