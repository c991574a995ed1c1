/* The lowest eigenpairs of a symmetric sparse matrix, by Spectra and Eigen, which are templates: nothing is linked. */
#ifndef ORB_SPECTRAL_EIGEN_H
#define ORB_SPECTRAL_EIGEN_H

#include "orbmorph/context.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct orb_entry {
  int32_t row, column;
  double value;
} orb_entry;

/* Solves K x = λ diag(mass) x for the `wanted` lowest λ, in ascending order. K is symmetric and positive semidefinite;
 * entries of the same place add up. mass > 0; 3 · wanted ≤ n. vectors: wanted × n, one vector after the other, each of
 * length 1 in the inner product of mass. *found 0: the iteration has not converged, or the matrix is not finite.
 * Shift-and-invert Lanczos from a fixed vector, so the same input gives the same bits. One thread.
 */
ORB_MUST_CHECK orb_status orb_eigen_lowest(orb_context *ctx, int32_t n, const orb_entry *entries, int64_t count,
                                           const double *mass, int32_t wanted, double *values, double *vectors,
                                           int *found);

#ifdef __cplusplus
}
#endif

#endif
