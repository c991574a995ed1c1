/* Rotation along the way from one direction to another. */
#ifndef ORB_NUMERIC_ROTATE_ALONG_H
#define ORB_NUMERIC_ROTATE_ALONG_H

#include "numeric/vec3.h"

/* 1 + the cosine of an angle so near to 180° that the axis of the shortest rotation is rounding only. */
#define ORB_OPPOSITE 1e-9

/* Rotates v as the shortest rotation from `before` to `after` does (Rodrigues' formula); both are unit vectors. */
static inline void orb_rotate_along(const double before[3], const double after[3], const double v[3], double out[3]) {
  double axis[3], across[3];
  double cosine = orb_dot(before, after);
  orb_cross(before, after, axis);
  orb_cross(axis, v, across);
  double along = orb_dot(axis, v) / fmax(1 + cosine, ORB_OPPOSITE);
  for (int k = 0; k < 3; k++) {
    out[k] = cosine * v[k] + across[k] + along * axis[k];
  }
}

#endif
