/* Two spherical triangulations, the layers, and their overlay. */
#ifndef ORB_REMESH_OVERLAY_LAYERS_H
#define ORB_REMESH_OVERLAY_LAYERS_H

#include "sphere/locate.h"
#include "sphere/trace.h"

typedef struct orb_layer {
  orb_sphere_view view;
  int32_t vertex_count;
  const orb_locator *locator;
  /* Filled by orb_overlay_trace() and orb_overlay_faces(). */
  orb_spot *spot;      /* per vertex: where it lies in the other layer */
  int32_t *id;         /* per vertex: its number in the overlay */
  int32_t *edge;       /* per half-edge: its edge */
  int32_t *half;       /* per edge: the lower of its half-edges, which gives its direction */
  int32_t *begin;      /* per edge, and one more: its first event */
  orb_crossing *event; /* what the edge meets of the other layer, in order */
  int32_t *event_id;   /* per event: the overlay vertex there */
} orb_layer;

/* Vertices: first those of layer 0, then those of layer 1 that do not coincide with one, then proper crossings.
 * Triangles: each lies in triangle parent[2t + l] of layer l. */
typedef struct orb_overlay {
  orb_layer layer[2];
  int32_t vertex_count, triangle_count, crossing_count;
  int32_t *lone; /* vertices of layer 1 that coincide with none of layer 0, in ascending order */
  int32_t lone_count;
  int32_t *cross;    /* per crossing: its edges in layer 0 and in layer 1 */
  double *points;    /* 3 per vertex; those of crossings are rounded */
  orb_place *places; /* layer major: places[l · vertex_count + v] */
  int32_t *triangles, *parent;
  int32_t *merged; /* pairs (gone, kept) of vertices that the repair merged; the gone ones have no triangles */
  int32_t merged_count;
} orb_overlay;

#endif
