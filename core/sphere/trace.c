/* The walk of an arc p→q. A vertex lies left of the arc where orient(p, q, vertex) > 0. An arc leaves a triangle over
 * the half-edge whose origin lies right and whose end lies left, or through a corner that lies on it; it ends in the
 * triangle if q is not strictly beyond that edge. Since arcs are shorter than a half circle, "beyond" is one exact
 * orientation too. */
#include "sphere/trace.h"

#include "base/check.h"
#include "numeric/predicates.h"
#include "numeric/vec3.h"
#include "orbmorph/mesh.h"

enum { ENDED = 0, ENTERED = ORB_TRACE_ENTERED, AT_VERTEX, IN_FACE, ON_EDGE };

orb_spot orb_spot_of(const orb_hit *hit) {
  int corner = orb_hit_corner(hit);
  int32_t edge = orb_hit_edge(hit);
  if (corner >= 0) {
    return (orb_spot){3 * hit->triangle + corner, ORB_SPOT_VERTEX};
  }
  if (edge >= 0) {
    return (orb_spot){edge, ORB_SPOT_EDGE};
  }
  return (orb_spot){3 * hit->triangle, ORB_SPOT_FACE};
}

static const double *corner(const orb_arc_tracer *t, int32_t h) {
  return t->mesh->points + 3 * (int64_t)t->mesh->triangles[h];
}

/* The sign of orient(p, q, origin of h), by the filter of orb_orient() with the part of p and q computed once. */
static int side(const orb_arc_tracer *t, int32_t h) {
  const double *c = corner(t, h);
  double x = c[0] - t->p[0], y = c[1] - t->p[1], z = c[2] - t->p[2];
  double d = t->normal[0] * x + t->normal[1] * y + t->normal[2] * z;
  if (fabs(d) > ORB_ORIENT_RELATIVE * t->size * (fabs(x) + fabs(y) + fabs(z)) + ORB_ORIENT_LEAST) {
    return d > 0 ? 1 : -1;
  }
  return orb_orient(t->p, t->q, c);
}

/* The sign of q against edge h; negative: q lies beyond it. */
static int within(const orb_arc_tracer *t, int32_t h) {
  return orb_orient(corner(t, h), corner(t, orb_next(h)), t->q);
}

void orb_trace_start(orb_arc_tracer *tracer, const orb_sphere_view *mesh, orb_spot from, const double p[3],
                     const double q[3]) {
  double u[3];
  *tracer = (orb_arc_tracer){.mesh = mesh, .p = p, .q = q, .target = {-1, -1}, .vertex = -1, .h = from.h};
  orb_sub(q, p, u);
  orb_cross(p, u, tracer->normal);
  tracer->size = (fabs(p[0]) + fabs(p[1]) + fabs(p[2])) * (fabs(u[0]) + fabs(u[1]) + fabs(u[2]));
  tracer->state = from.kind == ORB_SPOT_VERTEX ? AT_VERTEX : from.kind == ORB_SPOT_EDGE ? ON_EDGE : IN_FACE;
}

void orb_trace_between(orb_arc_tracer *tracer, const orb_sphere_view *mesh, orb_spot from, const double p[3],
                       orb_spot to, const double q[3]) {
  orb_trace_start(tracer, mesh, from, p, q);
  tracer->end = to;
  if (to.kind == ORB_SPOT_VERTEX) {
    tracer->vertex = mesh->triangles[to.h];
  } else {
    tracer->target[0] = to.h / 3;
    tracer->target[1] = to.kind == ORB_SPOT_EDGE ? mesh->twin[to.h] / 3 : to.h / 3;
  }
}

/* Whether the arc, which has just entered the triangle of h, ends there, if it is known where q lies. */
static int is_reached(const orb_arc_tracer *t) {
  int32_t triangle = t->h / 3;
  const int32_t *c = t->mesh->triangles + 3 * (int64_t)triangle;
  return triangle == t->target[0] || triangle == t->target[1] ||
         (t->vertex >= 0 && (c[0] == t->vertex || c[1] == t->vertex || c[2] == t->vertex));
}

static int end_at(orb_arc_tracer *t, int32_t h, orb_spot_kind kind) {
  t->end = (orb_spot){h, (int32_t)kind};
  t->state = ENDED;
  return 0;
}

/* Leaves over edge h, unless q lies on this side of it. */
static int leave_over(orb_arc_tracer *t, int32_t h, orb_crossing *out) {
  int known = t->state == ENTERED && (t->vertex >= 0 || t->target[0] >= 0);
  int sign = known ? -1 : within(t, h);
  if (sign >= 0) {
    return end_at(t, h, sign == 0 ? ORB_SPOT_EDGE : ORB_SPOT_FACE);
  }
  *out = (orb_crossing){h, 0};
  t->h = t->mesh->twin[h];
  t->state = ENTERED;
  return 1;
}

/* Leaves through the origin of h, which lies on the arc, unless q comes first. */
static int leave_through(orb_arc_tracer *t, int32_t h, orb_crossing *out) {
  int after = within(t, h), before = within(t, orb_prev(h));
  if (after >= 0 && before >= 0) {
    return end_at(t, h, after == 0 && before == 0 ? ORB_SPOT_VERTEX : ORB_SPOT_FACE);
  }
  *out = (orb_crossing){h, 1};
  t->h = h;
  t->state = AT_VERTEX;
  return 1;
}

/* Runs along an edge to the origin of `to`, unless q comes first; `gate` is the edge at that vertex that is not on the
 * arc. */
static int run_along(orb_arc_tracer *t, int32_t edge, int32_t to, int32_t gate, orb_crossing *out) {
  int sign = within(t, gate);
  if (sign >= 0) {
    return sign == 0 ? end_at(t, to, ORB_SPOT_VERTEX) : end_at(t, edge, ORB_SPOT_EDGE);
  }
  *out = (orb_crossing){to, 1};
  t->h = to;
  t->state = AT_VERTEX;
  return 1;
}

static int from_entered(orb_arc_tracer *t, orb_crossing *out) {
  if (is_reached(t)) {
    t->state = ENDED;
    return 0;
  }
  int32_t apex = orb_prev(t->h);
  int s = side(t, apex);
  if (s > 0) {
    return leave_over(t, orb_next(t->h), out);
  }
  return s < 0 ? leave_over(t, apex, out) : leave_through(t, apex, out);
}

static int from_face(orb_arc_tracer *t, orb_crossing *out) {
  int32_t first = t->h - t->h % 3;
  int s[3];
  for (int k = 0; k < 3; k++) {
    s[k] = side(t, first + k);
  }
  for (int k = 0; k < 3; k++) {
    if (s[k] < 0 && s[(k + 1) % 3] > 0) {
      return leave_over(t, first + k, out);
    }
  }
  for (int k = 0; k < 3; k++) {
    if (s[k] == 0 && s[(k + 1) % 3] > 0 && s[(k + 2) % 3] < 0) {
      return leave_through(t, first + k, out);
    }
  }
  ORB_ASSERT(0 && "an arc leaves the triangle it starts in");
  return 0;
}

static int from_edge(orb_arc_tracer *t, orb_crossing *out) {
  int s = side(t, t->h);
  if (s != 0) {
    if (s < 0) {
      t->h = t->mesh->twin[t->h];
    }
    t->state = ENTERED;
    return from_entered(t, out);
  }
  int32_t apex = orb_prev(t->h);
  if (side(t, apex) > 0) { /* along h, to its end */
    return run_along(t, t->h, orb_next(t->h), orb_next(t->h), out);
  }
  return run_along(t, t->h, t->h, apex, out);
}

static int from_vertex(orb_arc_tracer *t, orb_crossing *out) {
  int32_t first = t->h, h = first;
  int s = side(t, orb_next(h));
  do {
    int next = side(t, orb_prev(h));
    if (next > 0 && s < 0) {
      return leave_over(t, orb_next(h), out);
    }
    if (next > 0 && s == 0) {
      return run_along(t, h, orb_next(h), orb_next(h), out);
    }
    s = next;
    h = t->mesh->twin[orb_prev(h)];
  } while (h != first);
  ORB_ASSERT(0 && "some wedge of a vertex holds every arc from it");
  return 0;
}

int orb_trace_next(orb_arc_tracer *t, orb_crossing *out) {
  switch (t->state) {
    case ENTERED:
      return from_entered(t, out);
    case AT_VERTEX:
      return from_vertex(t, out);
    case IN_FACE:
      return from_face(t, out);
    case ON_EDGE:
      return from_edge(t, out);
    default:
      return 0;
  }
}
