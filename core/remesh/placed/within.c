/* The walk of an edge through a shape, as in sphere/trace.c, with the distances taken on the way. Sides are decided by
 * the same filter; where that fails, or the arc meets a vertex, the exact tracer takes over. */
#include <math.h>

#include "numeric/predicates.h"
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

/* Where an arc is: it entered the triangle of h over h, from the left end of h to its right. */
typedef struct stand {
  int32_t h;
  const orb_pack_vertex *left, *right;
  double of_left, of_right; /* their distances from the plane of the arc; left is positive */
} stand;

/* The distance of a vertex from the plane of the arc; NAN where rounding might have changed its sign. */
static inline double side_of(const orb_arc_tracer *t, const orb_pack_vertex *v) {
  double u[3];
  orb_sub(v->point, t->p, u);
  double d = orb_dot(t->normal, u);
  return fabs(d) > ORB_ORIENT_RELATIVE * t->size * (fabs(u[0]) + fabs(u[1]) + fabs(u[2])) + ORB_ORIENT_LEAST ? d : NAN;
}

static inline int ends_in(const orb_arc_tracer *t, int32_t triangle) {
  const int32_t *c = t->mesh->triangles + 3 * (int64_t)triangle;
  return triangle == t->target[0] || triangle == t->target[1] || c[0] == t->vertex || c[1] == t->vertex ||
         c[2] == t->vertex;
}

enum { ENDS, LEAVES, UNCLEAR };

/* The first step from within a face. */
static int leave_face(const orb_arc_tracer *t, const orb_pack *pack, int32_t triangle, stand *out) {
  const int32_t *c = t->mesh->triangles + 3 * (int64_t)triangle;
  const orb_pack_vertex *v[3];
  double d[3];
  if (ends_in(t, triangle)) {
    return ENDS;
  }
  for (int k = 0; k < 3; k++) {
    v[k] = &pack->vertex[c[k]];
    d[k] = side_of(t, v[k]);
  }
  for (int k = 0; k < 3; k++) {
    int next = k < 2 ? k + 1 : 0;
    if (d[k] < 0 && d[next] > 0) {
      *out = (stand){t->mesh->twin[3 * triangle + k], v[next], v[k], d[next], d[k]};
      return LEAVES;
    }
  }
  return UNCLEAR;
}

/* The first step from a vertex, which h leaves. */
static int leave_vertex(const orb_arc_tracer *t, const orb_pack *pack, int32_t first, stand *out) {
  const int32_t *corner = t->mesh->triangles, *twin = t->mesh->twin;
  int32_t h = first;
  const orb_pack_vertex *right = &pack->vertex[corner[orb_next(h)]];
  double of_right = side_of(t, right);
  do {
    const orb_pack_vertex *left = &pack->vertex[corner[orb_prev(h)]];
    double of_left = side_of(t, left);
    if (of_right < 0 && of_left > 0) {
      *out = (stand){twin[orb_next(h)], left, right, of_left, of_right};
      return ends_in(t, h / 3) ? ENDS : LEAVES;
    }
    right = left;
    of_right = of_left;
    h = twin[orb_prev(h)];
  } while (h != first);
  return UNCLEAR;
}

/* Follows the arc over the edges that it crosses. */
static double walk_within2(orb_arc_tracer *t, const orb_pack *pack, const chord *e, double limit2, stand at) {
  double greatest = segment_within2(e, at.left, at.right, at.of_left, at.of_right, limit2);
  for (int i = 0; i < STEPS_MOST && greatest <= limit2; i++) {
    orb_pack_step step = pack->step[at.h];
    int32_t triangle = at.h / 3;
    if (triangle == t->target[0] || triangle == t->target[1] || step.apex == t->vertex) {
      return greatest;
    }
    const orb_pack_vertex *apex = &pack->vertex[step.apex];
    double of_apex = side_of(t, apex);
    if (of_apex > 0) {
      at = (stand){step.over[0], apex, at.right, of_apex, at.of_right};
    } else if (of_apex < 0) {
      at = (stand){step.over[1], at.left, apex, at.of_left, of_apex};
    } else {
      break;
    }
    greatest = fmax(greatest, segment_within2(e, at.left, at.right, at.of_left, at.of_right, limit2));
  }
  t->state = ORB_TRACE_ENTERED;
  t->h = at.h;
  return trace_within2(t, pack, e, limit2, greatest);
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
  orb_arc_tracer t;
  orb_trace_between(&t, &placed->view[s], from, orb_net_point(&placed->net, v), to, orb_net_point(&placed->net, w));
  stand at;
  int way = from.kind == ORB_SPOT_FACE     ? leave_face(&t, pack, from.h / 3, &at)
            : from.kind == ORB_SPOT_VERTEX ? leave_vertex(&t, pack, from.h, &at)
                                           : UNCLEAR;
  return way == ENDS     ? 0
         : way == LEAVES ? walk_within2(&t, pack, &e, limit2, at)
                         : trace_within2(&t, pack, &e, limit2, 0);
}
