/* Traces arcs on the sphere through an embedded mesh: which edges they cross and which vertices they pass, in order.
 * Every decision is an exact orientation, also where points coincide; no coordinates are constructed. */
#ifndef ORB_SPHERE_TRACE_H
#define ORB_SPHERE_TRACE_H

#include "sphere/walk.h"

typedef enum orb_spot_kind { ORB_SPOT_FACE = 0, ORB_SPOT_EDGE, ORB_SPOT_VERTEX } orb_spot_kind;

/* The feature of a mesh that a direction lies on: half-edge h leaves the vertex, is the edge, or is any of the face. */
typedef struct orb_spot {
  int32_t h;
  int32_t kind;
} orb_spot;

orb_spot orb_spot_of(const orb_hit *hit);

/* What an arc meets strictly between its ends: an edge crossed at a point inside it (h belongs to the triangle that the
 * arc leaves), or a vertex passed exactly (h leaves it). */
typedef struct orb_crossing {
  int32_t h;
  int32_t at_vertex;
} orb_crossing;

enum { ORB_TRACE_ENTERED = 1 }; /* the state of a tracer that has entered the face of h over h */

typedef struct orb_arc_tracer {
  const orb_sphere_view *mesh;
  const double *p, *q;
  double normal[3], size;    /* p × (q − p), and the product of their 1-norms: for the filter of side tests */
  int32_t target[2], vertex; /* if it is known where q lies: the triangles, or the vertex, to end at; else −1 */
  int state; /* 0 ended, 1 in the face of h, entered over h, 2 at the origin of h, 3 started in the face of h, 4 on h */
  int32_t h;
  orb_spot end; /* once ended: the feature that q lies on */
} orb_arc_tracer;

/* Starts at p, which lies at `from` in the mesh, towards q: less than a half circle away, and not equal to p. */
void orb_trace_start(orb_arc_tracer *tracer, const orb_sphere_view *mesh, orb_spot from, const double p[3],
                     const double q[3]);

/* The same if q is known to lie at `to`: steps cost half as much. */
void orb_trace_between(orb_arc_tracer *tracer, const orb_sphere_view *mesh, orb_spot from, const double p[3],
                       orb_spot to, const double q[3]);

/* Finds the next crossing; returns 0 once q is reached. */
int orb_trace_next(orb_arc_tracer *tracer, orb_crossing *out);

#endif
