/* A symmetric positive definite sparse matrix that is factorised repeatedly, with different diagonals, by Eigen's
 * templates: nothing is linked. */
#ifndef ORB_NUMERIC_FACTOR_H
#define ORB_NUMERIC_FACTOR_H

#include "orbmorph/context.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct orb_factor orb_factor;

/* One entry below or above the diagonal. The matrix has `value` at both of its places. */
typedef struct orb_coupling {
  int32_t row, column;
  double value;
} orb_coupling;

/* Orders the unknowns and finds the pattern of the factor. Entries of one place add up. The factor counts in the budget
 * of the context: O(n log n) for a surface. */
ORB_MUST_CHECK orb_status orb_factor_create(orb_context *ctx, int32_t n, const orb_coupling *couplings, int64_t count,
                                            orb_factor **out);
void orb_factor_destroy(orb_context *ctx, orb_factor *factor); /* NULL is fine */

/* Factorises with this diagonal, which must make the sum of every row positive. O(n^1.5) for a surface. */
ORB_MUST_CHECK orb_status orb_factor_compute(orb_factor *factor, const double *diagonal);

/* Solves for three right sides at once: x and right are 3 per unknown. O(n log n) for a surface. */
void orb_factor_solve3(const orb_factor *factor, const double *right, double *x);

#ifdef __cplusplus
}
#endif

#endif
