/* The rotation nearest to a matrix. */
#ifndef ORB_NUMERIC_ROTATION_H
#define ORB_NUMERIC_ROTATION_H

/* Sets r to the rotation nearest to the 3×3 matrix h, both row-major (Kabsch 1976; never a reflection). As a
 * quaternion, r is the eigenvector of the greatest eigenvalue of a 4×4 matrix. Where the next eigenvalue is near, r
 * comes from the singular values of h. Returns 0 if h is not finite. */
int orb_nearest_rotation(const double h[9], double r[9]);

#endif
