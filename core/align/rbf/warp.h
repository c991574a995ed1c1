/* The interpolating warp of Peng & Timalsena 2016, section 7.2. */
#ifndef ORB_ALIGN_RBF_WARP_H
#define ORB_ALIGN_RBF_WARP_H

#include "orbmorph/alignment.h"

/* φ(r) = 1 − 30r² − 10r³ + 45r⁴ − 6r⁵ − 60r³ ln r on [0, 1], 0 beyond (de Boer et al. 2007, compact thin-plate C²);
 * φ(1) = 0. */
double orb_warp_phi(double r);

/* Displacement field d(v) = Σ φ(|v − p_k| / radius_k) c_k + P(v), P linear, that takes centres p to p + moves. Side
 * conditions Σ c_k = 0, Σ c_k p_kᵀ = 0. Where the centres do not determine a linear polynomial (fewer than four, or all
 * in one plane) P is omitted. */
typedef struct orb_warp {
  int32_t count;
  double *centres, *coefficients, *radii; /* 3, 3 and 1 per centre */
  double linear[4][3];                    /* P(v) = linear[0] + Σ v_i linear[i + 1] */
} orb_warp;

/* O(count³). ORB_E_BAD_LANDMARKS where the centres are too close to tell apart. */
ORB_MUST_CHECK orb_status orb_warp_create(orb_context *ctx, const double *centres, const double *moves,
                                          const double *radii, int32_t count, orb_warp *out);
void orb_warp_free(orb_context *ctx, orb_warp *warp);

/* Moves points (3 each) by the field and back onto the sphere. */
void orb_warp_apply(orb_context *ctx, const orb_warp *warp, const double *points, int32_t count, double *out);

#endif
