#include "numeric/frame.h"

#include <math.h>

void orb_tangent_frame(const double p[3], double e1[3], double e2[3]) {
  double s = copysign(1, p[2]), a = -1 / (s + p[2]), b = p[0] * p[1] * a;
  e1[0] = 1 + s * p[0] * p[0] * a;
  e1[1] = s * b;
  e1[2] = -s * p[0];
  e2[0] = b;
  e2[1] = s + p[1] * p[1] * a;
  e2[2] = -p[1];
}
