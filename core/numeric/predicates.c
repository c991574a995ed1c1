#include "numeric/predicates.h"

#include "numeric/vec3.h"

int orb_orient(const double a[3], const double b[3], const double c[3]) {
  double d = orb_det(a, b, c);
  return (d > 0) - (d < 0);
}
