/* A mesh with what the steps of a registration read. */
#ifndef ORB_ELASTIC_BODY_H
#define ORB_ELASTIC_BODY_H

#include "elastic/searched.h"

typedef struct orb_body {
  const orb_mesh *mesh; /* borrowed */
  int32_t count;        /* vertices */
  double *normal;       /* unit, weighted by area; 3 per vertex */
  double *mass;         /* a third of the area of the triangles around each vertex */
  orb_searched searched;
  int32_t *start, *next; /* the edges of vertex v are start[v] … start[v + 1] − 1 */
  double *weight;        /* the sum of half the cotangents of both triangles, each clamped so that all are positive */
} orb_body;

/* Free `out` in any case; the mesh must outlive it. O(n). */
ORB_MUST_CHECK orb_status orb_body_create(orb_context *ctx, const orb_mesh *mesh, orb_body *out);
void orb_body_free(orb_context *ctx, orb_body *body);

/* Unit normals of the mesh at these positions (3 per vertex). mass may be NULL. */
void orb_body_normals(const orb_mesh *mesh, const double *position, double *normal, double *mass);

#endif
