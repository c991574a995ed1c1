/* The best rotation between two sets of vectors. */
#ifndef ORB_TRANSFER_ROTATION_H
#define ORB_TRANSFER_ROTATION_H

/* h[i][j] = Σ w a_i b_j over vectors a and their images b. q: the unit quaternion (w, x, y, z; w ≥ 0) of the rotation R
 * that maximises Σ w b·Ra. Source: Horn 1987, by Jacobi rotations on his 4×4 matrix. Never a reflection. */
void orb_rotation_fit(double h[3][3], double q[4]);

void orb_rotation_matrix(const double q[4], double out[3][3]);

#endif
