#include "numeric/rotation.h"

#include <math.h>

#include "numeric/dense.h"
#include "numeric/vec3.h"

int orb_nearest_rotation(const double h[9], double r[9]) {
  double u[9], v[9], sv[3];
  for (int i = 0; i < 9; i++) {
    if (!isfinite(h[i])) {
      return 0;
    }
  }
  orb_svd3(h, u, sv, v);
  for (int pass = 0; pass < 2; pass++) {
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < 3; j++) {
        r[3 * i + j] = u[3 * i] * v[3 * j] + u[3 * i + 1] * v[3 * j + 1] + u[3 * i + 2] * v[3 * j + 2];
      }
    }
    double c[3];
    orb_cross(r, r + 3, c);
    if (orb_dot(c, r + 6) > 0) {
      return 1;
    }
    for (int i = 0; i < 3; i++) {
      u[3 * i + 2] = -u[3 * i + 2];
    }
  }
  return 1;
}
