/* The rotation nearest to a matrix. */
#ifndef ORB_NUMERIC_ROTATION_H
#define ORB_NUMERIC_ROTATION_H

/* Sets r to the rotation nearest to the 3×3 matrix h, both row-major (Kabsch 1976; never a reflection). As a
 * quaternion, r is the eigenvector of the greatest eigenvalue of a 4×4 matrix. Where the next eigenvalue is near, r
 * comes from the singular values of h. Returns 0 if h is not finite. */
int orb_nearest_rotation(const double h[9], double r[9]);

/* The same for up to ORB_ROTATIONS matrices at once, in a fifth of the time. h: element k of matrix i is h[k][i]; all
 * must be set, also of matrices from `count` on, and are overwritten. r: 9 for each. A matrix that is not finite leaves
 * its rotation as it is. */
enum { ORB_ROTATIONS = 8 }; /* doubles of the widest vector */
void orb_nearest_rotations(double h[9][ORB_ROTATIONS], int count, double *r);

#endif
