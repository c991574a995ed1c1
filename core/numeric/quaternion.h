/* Unit quaternions as rotations: the cosine of half the angle comes first. q and −q are one rotation. */
#ifndef ORB_NUMERIC_QUATERNION_H
#define ORB_NUMERIC_QUATERNION_H

#include <string.h>

/* r: the rotation, row-major; it acts on columns. */
static inline void orb_quaternion_rotation(const double q[4], double r[9]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                       2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                       2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  memcpy(r, m, sizeof m);
}

/* The rotation b, then the rotation a. out may be a or b. */
static inline void orb_quaternion_product(const double a[4], const double b[4], double out[4]) {
  const double q[4] = {
      a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
      a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  memcpy(out, q, sizeof q);
}

#endif
