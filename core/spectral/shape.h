/* The spectral search's data of one shape: its lowest eigenfunctions and a few samples. */
#ifndef ORB_SPECTRAL_SHAPE_H
#define ORB_SPECTRAL_SHAPE_H

#include "orbmorph/mesh.h"

enum {
  ORB_SPECTRAL_FUNCTIONS = 31, /* eigenfunctions, the constant one included */
  ORB_SPECTRAL_SAMPLES = 160,
  ORB_SPECTRAL_DETAILS = 3,   /* the first 40, the first 80, or all samples represent the shape */
  ORB_SPECTRAL_GRADIENTS = 6, /* functions whose gradients are compared */
  ORB_SPECTRAL_TRIPLES = ORB_SPECTRAL_GRADIENTS * (ORB_SPECTRAL_GRADIENTS - 1) / 2 /* pairs of them */
};

/* In units in which the area is 1. Functions are orthonormal under the lumped mass. Samples are spread by farthest
 * points, so the first few are spread too, and tips of limbs come first. */
typedef struct orb_spectral_shape {
  const orb_mesh *mesh; /* borrowed */
  int is_usable;        /* 0: too few vertices, or the eigenproblem was not solved; nothing else is filled then */
  double value[ORB_SPECTRAL_FUNCTIONS];
  double *function; /* function k at vertex v: [k · vertices + v] */
  int32_t sample[ORB_SPECTRAL_SAMPLES];
  float at[ORB_SPECTRAL_FUNCTIONS][ORB_SPECTRAL_SAMPLES]; /* the functions at the samples */
  /* The share of the area nearest to each sample, among the first orb_spectral_samples(detail); the sum is 1. */
  double share[ORB_SPECTRAL_DETAILS][ORB_SPECTRAL_SAMPLES];
  /* normal · (gradient of i × gradient of k) at each sample, i < k, row by row: changes sign under a mirror image */
  float triple[ORB_SPECTRAL_TRIPLES][ORB_SPECTRAL_SAMPLES];
  float *distance; /* along the surface, samples × samples */
  float *height;   /* of sample k over the tangent plane at sample i: [i · samples + k] */
} orb_spectral_shape;

static inline int32_t orb_spectral_samples(int detail) {
  return ORB_SPECTRAL_SAMPLES >> (ORB_SPECTRAL_DETAILS - 1 - detail);
}

/* Free `out` in any case; the mesh must outlive it. mirrored: as if the surface were its mirror image. */
ORB_MUST_CHECK orb_status orb_spectral_shape_create(orb_context *ctx, const orb_mesh *mesh, int mirrored,
                                                    orb_spectral_shape *out);
/* Makes a shape as if its surface were its mirror image. A copy of the struct borrows what the shape holds, but has
 * orientations of its own, so it may be mirrored alone. */
void orb_spectral_shape_mirror(orb_spectral_shape *shape);
void orb_spectral_shape_free(orb_context *ctx, orb_spectral_shape *shape);

#endif
