/* The overlay of two spherical triangulations: their exact common refinement. */
#ifndef ORB_REMESH_OVERLAY_OVERLAY_H
#define ORB_REMESH_OVERLAY_OVERLAY_H

#include "orbmorph/remesh.h"
#include "remesh/methods.h"
#include "sphere/trace.h"

/* One of the two triangulations. */
typedef struct orb_layer {
  orb_sphere_view view;
  int32_t vertex_count;
  const orb_locator *locator;
  /* Filled by the overlay. */
  orb_spot *spot;      /* a vertex: where it lies in the other layer */
  int32_t *id;         /* a vertex: its number in the overlay */
  int32_t *edge;       /* a half-edge: its edge */
  int32_t *half;       /* an edge: the lower of its half-edges, which gives its direction */
  int32_t *begin;      /* an edge (and one more): its first event */
  orb_crossing *event; /* what the edge meets of the other layer, in order */
  int32_t *event_id;   /* an event: the overlay vertex there */
} orb_layer;

/* Vertices: first those of layer 0, then those of layer 1 that do not coincide with one, then proper crossings.
 * Triangles: each lies in triangle parent[2t + l] of layer l. */
typedef struct orb_overlay {
  orb_layer layer[2];
  int32_t vertex_count, triangle_count, crossing_count;
  int32_t *lone; /* layer 1's vertices that do not coincide, in the order of their numbers */
  int32_t lone_count;
  int32_t *cross;    /* a crossing: its edges in layer 0 and in layer 1 */
  double *points;    /* 3 a vertex, rounded */
  orb_place *places; /* layer major: places[l · vertex_count + v] */
  int32_t *triangles, *parent;
  int32_t *merged; /* pairs (gone, kept) of vertices that rounding made one; the gone ones have no triangles */
  int32_t merged_count;
} orb_overlay;

/* Overlays layers whose view, vertex_count and locator are given. Triangles are those of the exact arrangement;
 * rounding of the crossings may have turned some over: see orb_overlay_untangle(). */
ORB_MUST_CHECK orb_status orb_overlay_build(orb_context *ctx, orb_overlay *overlay);
void orb_overlay_free(orb_context *ctx, orb_overlay *overlay);

/* The points of the upper layer with each vertex that lies within rounding (1e-9) of one of the layer below at that
 * very point, as far as all triangles stay positive. points: 3 a vertex of the layer, of the caller. *snapped: how many
 * vertices moved. Needs views, vertex_count, and the locator below. */
ORB_MUST_CHECK orb_status orb_overlay_snap(orb_context *ctx, const orb_layer *below, const orb_layer *layer,
                                           double *points, int32_t *snapped);

/* The steps of it: events and vertices; then the graph's faces and triangles. */
ORB_MUST_CHECK orb_status orb_overlay_trace(orb_context *ctx, orb_overlay *overlay);
ORB_MUST_CHECK orb_status orb_overlay_faces(orb_context *ctx, orb_overlay *overlay);

/* Moves vertices numbered `first_free` and above until every triangle is positive; ORB_E_NOT_CERTIFIED if some stays
 * turned. Points move by about the rounding that turned them. */
ORB_MUST_CHECK orb_status orb_overlay_untangle(orb_context *ctx, double *points, int32_t vertex_count,
                                               const int32_t *triangles, int32_t triangle_count, int32_t first_free);

/* Makes all triangles of a built overlay positive: by untangling, and where vertices lie too close together for that,
 * by merging them. */
ORB_MUST_CHECK orb_status orb_overlay_mend(orb_context *ctx, orb_overlay *overlay);

#endif
