/* The best rotation between two sets of vectors, and rotation vectors. */
#ifndef ORB_TRANSFER_ROTATION_H
#define ORB_TRANSFER_ROTATION_H

/* h[i][j] = Σ w a_i b_j over vectors a and their images b. q: the unit quaternion (w, x, y, z; w ≥ 0) of the rotation R
 * that maximises Σ w b·Ra. Source: Horn 1987; Jacobi rotations diagonalise the 4×4 matrix. Never a reflection. */
void orb_rotation_fit(double h[3][3], double q[4]);

/* The same rotation as a vector: along the axis, as long as the angle in radians (0 to π). */
void orb_rotation_vector(double h[3][3], double out[3]);

/* v rotated by t times the rotation vector w (Rodrigues' formula). */
void orb_rotate_by(const double w[3], double t, const double v[3], double out[3]);

void orb_rotation_matrix(const double q[4], double out[3][3]);

#endif
