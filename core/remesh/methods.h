/* The remesh methods behind orb_remesh(). Each fills triangles, points, places and error bounds; landmarks and the
 * certificate are common and come after. */
#ifndef ORB_REMESH_METHODS_H
#define ORB_REMESH_METHODS_H

#include "orbmorph/remesh.h"
#include "sphere/net.h"

/* What all methods need of the shapes. */
typedef struct orb_remesh_job {
  const orb_aligned_shape *shapes;
  int32_t shape_count;
  int32_t landmark_count;
  const orb_remesh_options *options;
  int32_t **twin;        /* a shape: half-edge pairing */
  orb_locator **locator; /* a shape */
  double *diagonal;      /* a shape: of its bounding box */
} orb_remesh_job;

/* Finds the place of every supermesh vertex on every shape; out->points and vertex_count are given. */
ORB_MUST_CHECK orb_status orb_remesh_places(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);

ORB_MUST_CHECK orb_status orb_remesh_subdivision(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);
ORB_MUST_CHECK orb_status orb_remesh_adaptive(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);
ORB_MUST_CHECK orb_status orb_remesh_overlay(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);
ORB_MUST_CHECK orb_status orb_remesh_hull(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);

#endif
