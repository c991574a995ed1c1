/* Small dense algebra: a linear solver and the singular value decomposition of 3 × 3. Results have the same bits on
 * every machine with IEEE doubles; no library brings threads or buffers of its own. */
#ifndef ORB_NUMERIC_DENSE_H
#define ORB_NUMERIC_DENSE_H

#include <stdint.h>

/* Solves matrix · X = right by Gaussian elimination with row pivoting (blocked, right-looking; Golub & Van Loan 3.4).
 * matrix: n × n, right: n × columns, both row by row; the matrix is destroyed, right becomes X. Returns 0, or −1 if a
 * pivot is exactly zero or not finite. O(n³); for n up to a few thousand. */
int orb_dense_solve(int32_t n, double *matrix, int32_t columns, double *right);

/* a = u · diag(s) · vᵀ for a 3 × 3 matrix row by row, by one-sided Jacobi (Hestenes 1958): u and v orthogonal, their
 * columns the singular vectors, s0 ≥ s1 ≥ s2 ≥ 0. For any finite matrix, of any rank. */
void orb_svd3(const double a[9], double u[9], double s[3], double v[9]);

#endif
