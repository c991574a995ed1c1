/* The rotation nearest to a matrix. */
#ifndef ORB_NUMERIC_ROTATION_H
#define ORB_NUMERIC_ROTATION_H

#include "numeric/dense.h"

/* The rotation nearest to a 3×3 matrix, both row-major (Kabsch; reflections turned back). 0: it is not finite. */
int orb_nearest_rotation(const double h[9], double r[9]);

#endif
