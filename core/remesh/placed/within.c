/* The walk of an edge through a shape, as in sphere/trace.c, with the distances taken on the way. Sides are decided by
 * the same filter; where that fails, or the arc meets a vertex, the exact tracer takes over. */
#include <math.h>

#include "numeric/vec3.h"
#include "remesh/placed/bound.h"
#include "remesh/placed/distance.h"

/* Steps after which the exact tracer takes over: more than any edge crosses. */
enum { STEPS_MOST = 1 << 20 };

/* The edge of a net from a to b, in space. */
typedef struct chord {
  const double *a, *b;
  double ab[3], by_length2; /* b − a, and 1 / |ab|² */
} chord;

/* The squared distance between the edge and the segment c d, or an upper bound that is within the limit: the distance
 * of the point that divides c d as the arc does. of_c, of_d: the distances of c and d from the plane of the arc. */
static inline double segment_within2(const chord *e, const orb_pack_vertex *c, const orb_pack_vertex *d, double of_c,
                                     double of_d, double limit2) {
  double share = of_c / (of_c - of_d), x[3];
  for (int k = 0; k < 3; k++) {
    x[k] = c->position[k] + share * (d->position[k] - c->position[k]) - e->a[k];
  }
  double t = orb_clamp01(orb_dot(x, e->ab) * e->by_length2);
  for (int k = 0; k < 3; k++) {
    x[k] -= t * e->ab[k];
  }
  double distance2 = orb_dot(x, x);
  return distance2 <= limit2 ? distance2 : orb_segments2(e->a, e->b, c->position, d->position);
}

static double crossing_within2(const orb_pack *pack, const orb_sphere_view *view, const chord *e,
                               const orb_crossing *at) {
  const double *c = pack->vertex[view->triangles[at->h]].position;
  const double *d = pack->vertex[view->triangles[orb_next(at->h)]].position;
  return at->at_vertex ? orb_point_segment2(c, e->a, e->b) : orb_segments2(e->a, e->b, c, d);
}

/* The rest of the way by the exact tracer. */
static double trace_within2(orb_arc_tracer *t, const orb_pack *pack, const chord *e, double limit2, double greatest) {
  orb_crossing crossing;
  while (greatest <= limit2 && orb_trace_next(t, &crossing)) {
    greatest = fmax(greatest, crossing_within2(pack, t->mesh, e, &crossing));
  }
  return greatest;
}

double orb_placed_edge_within2(const orb_placed_net *placed, int32_t s, int32_t v, int32_t w, double limit2) {
  const orb_pack *pack = &placed->pack[s];
  orb_spot from = placed->spot[(int64_t)v * placed->shape_count + s],
           to = placed->spot[(int64_t)w * placed->shape_count + s];
  if (from.kind == ORB_SPOT_FACE && to.kind == ORB_SPOT_FACE && from.h / 3 == to.h / 3) {
    return 0; /* within one triangle */
  }
  chord e = {.a = orb_placed_position(placed, v, s), .b = orb_placed_position(placed, w, s)};
  orb_sub(e.b, e.a, e.ab);
  e.by_length2 = 1 / orb_dot(e.ab, e.ab);
  const double *p = orb_net_point(&placed->net, v);
  orb_arc_tracer t;
  orb_crossing crossing;
  orb_trace_between(&t, &placed->view[s], from, p, to, orb_net_point(&placed->net, w));
  if (!orb_trace_next(&t, &crossing)) {
    return 0;
  }
  double greatest = crossing_within2(pack, t.mesh, &e, &crossing);
  if (crossing.at_vertex) {
    return trace_within2(&t, pack, &e, limit2, greatest);
  }
  int32_t h = t.h; /* entered over h, from its left end to its right */
  const orb_pack_vertex *left = &pack->vertex[t.mesh->triangles[h]];
  const orb_pack_vertex *right = &pack->vertex[t.mesh->triangles[orb_next(h)]];
  double u[3];
  orb_sub(left->point, p, u);
  double of_left = orb_dot(t.normal, u);
  orb_sub(right->point, p, u);
  double of_right = orb_dot(t.normal, u);
  for (int i = 0; i < STEPS_MOST && greatest <= limit2; i++) {
    orb_pack_step step = pack->step[h];
    int32_t triangle = h / 3;
    if (triangle == t.target[0] || triangle == t.target[1] || step.apex == t.vertex) {
      return greatest;
    }
    const orb_pack_vertex *apex = &pack->vertex[step.apex];
    orb_sub(apex->point, p, u);
    double of_apex = orb_dot(t.normal, u);
    if (!(fabs(of_apex) > 1e-15 * t.size * (fabs(u[0]) + fabs(u[1]) + fabs(u[2])) + 1e-220)) {
      break;
    }
    if (of_apex > 0) {
      left = apex;
      of_left = of_apex;
      h = step.over[0];
    } else {
      right = apex;
      of_right = of_apex;
      h = step.over[1];
    }
    double distance2 = segment_within2(&e, left, right, of_left, of_right, limit2);
    greatest = distance2 > greatest ? distance2 : greatest;
  }
  t.h = h;
  return trace_within2(&t, pack, &e, limit2, greatest);
}
