/* The input of every remesh method: the shapes, and what orb_remesh() prepares for each. */
#ifndef ORB_REMESH_COMMON_JOB_H
#define ORB_REMESH_COMMON_JOB_H

#include "orbmorph/remesh.h"

/* The margin that proofs of distance leave for the rounding of a bound: relative to the tolerance, and relative to the
 * diagonal.
 */
static const double ORB_REMESH_ROUNDING = 1e-9, ORB_REMESH_ROUNDING_LEAST = 1e-12;

typedef struct orb_remesh_job {
  const orb_aligned_shape *shapes;
  int32_t shape_count;
  int32_t landmark_count;
  const orb_remesh_options *options;
  int32_t **twin;        /* per shape: half-edge pairing */
  orb_locator **locator; /* per shape */
  double *diagonal;      /* per shape: of its bounding box */
} orb_remesh_job;

/* The distance, relative to the diagonal, within which a method proves a result to lie. */
static inline double orb_remesh_limit(const orb_remesh_job *job) {
  return job->options->tolerance * (1 - ORB_REMESH_ROUNDING) - ORB_REMESH_ROUNDING_LEAST;
}

/* A method fills triangles, points, places and error bounds of `out`, whose error_bound holds shape_count NaN.
 * orb_remesh() finds the landmarks and certifies the result. */
typedef orb_status (*orb_remesh_fn)(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);

/* The function of each method: orb_remesh_adaptive() and so on. */
#define ORB_REMESH_DECLARATION(id, function, name, heeds) \
  ORB_MUST_CHECK orb_status orb_remesh_##function(orb_context *ctx, const orb_remesh_job *job, orb_supermesh *out);
ORB_REMESH_METHODS(ORB_REMESH_DECLARATION)
#undef ORB_REMESH_DECLARATION

#endif
