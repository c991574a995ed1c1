#include "numeric/rotation.h"

#include <math.h>
#include <string.h>

#include "numeric/dense.h"
#include "numeric/vec3.h"

/* Most Newton steps to an eigenvalue, from above; three or four suffice where it is far from the next one. */
enum { STEPS = 30 };
/* Least product of an eigenvalue's distances from the others, as a share of the cubed eigenvalue: with less, the steps
 * do not suffice. */
static const double CLEAR = 1e-3;

/* The determinant of the rows and columns of a 4×4 matrix but for one of each, with the sign of a cofactor. */
static double cofactor(double m[4][4], int row, int column) {
  const int r[3] = {row < 1, 1 + (row < 2), 2 + (row < 3)}, c[3] = {column < 1, 1 + (column < 2), 2 + (column < 3)};
  const double det = m[r[0]][c[0]] * (m[r[1]][c[1]] * m[r[2]][c[2]] - m[r[1]][c[2]] * m[r[2]][c[1]]) -
                     m[r[0]][c[1]] * (m[r[1]][c[0]] * m[r[2]][c[2]] - m[r[1]][c[2]] * m[r[2]][c[0]]) +
                     m[r[0]][c[2]] * (m[r[1]][c[0]] * m[r[2]][c[1]] - m[r[1]][c[1]] * m[r[2]][c[0]]);
  return (row + column) % 2 ? -det : det;
}

/* The greatest eigenvalue of a symmetric 4×4 matrix without trace (Theobald 2005). squares: of the elements of the 3×3
 * matrix that it comes from; det: that matrix's determinant. */
static double greatest_eigenvalue(double n[4][4], double squares, double det) {
  double c0 = 0, x = sqrt(3 * squares);
  for (int k = 0; k < 4; k++) {
    c0 += n[0][k] * cofactor(n, 0, k);
  }
  for (int i = 0; i < STEPS; i++) {
    const double x2 = x * x, slope = 4 * x2 * x - 4 * squares * x - 8 * det;
    const double step = slope > 0 ? (x2 * x2 - 2 * squares * x2 - 8 * det * x + c0) / slope : 0;
    x -= step;
    if (!(step > 1e-15 * x)) {
      break;
    }
  }
  return x;
}

/* By quaternions (Horn 1987). h is scaled to elements up to 1. Returns 0 where the rotation is not clear enough. */
static int rotate_by_quaternion(const double h[9], double r[9]) {
  double n[4][4] = {{h[0] + h[4] + h[8], h[7] - h[5], h[2] - h[6], h[3] - h[1]},
                    {h[7] - h[5], h[0] - h[4] - h[8], h[3] + h[1], h[2] + h[6]},
                    {h[2] - h[6], h[3] + h[1], -h[0] + h[4] - h[8], h[7] + h[5]},
                    {h[3] - h[1], h[2] + h[6], h[7] + h[5], -h[0] - h[4] + h[8]}};
  double squares = 0, q[4], greatest = 0, length = 0;
  for (int i = 0; i < 9; i++) {
    squares += h[i] * h[i];
  }
  const double value = greatest_eigenvalue(n, squares, orb_det(h, h + 3, h + 6));
  int row = 0;
  for (int k = 0; k < 4; k++) {
    n[k][k] -= value;
  }
  for (int k = 0; k < 4; k++) {
    q[k] = fabs(cofactor(n, k, k));
    row = q[k] > greatest ? k : row;
    greatest = fmax(greatest, q[k]);
  }
  if (!(greatest > CLEAR * value * value * value)) {
    return 0;
  }
  for (int k = 0; k < 4; k++) {
    q[k] = cofactor(n, row, k);
    length += q[k] * q[k];
  }
  const double w = q[0], x = q[1], y = q[2], z = q[3], two = 2 / length;
  const double out[9] = {1 - two * (y * y + z * z), two * (x * y - w * z),     two * (x * z + w * y),
                         two * (x * y + w * z),     1 - two * (x * x + z * z), two * (y * z - w * x),
                         two * (x * z - w * y),     two * (y * z + w * x),     1 - two * (x * x + y * y)};
  memcpy(r, out, sizeof out);
  return 1;
}

int orb_nearest_rotation(const double h[9], double r[9]) {
  double u[9], v[9], sv[3], scaled[9], greatest = 0;
  for (int i = 0; i < 9; i++) {
    if (!isfinite(h[i])) {
      return 0;
    }
    greatest = fmax(greatest, fabs(h[i]));
  }
  for (int i = 0; i < 9; i++) {
    scaled[i] = greatest > 0 ? h[i] / greatest : 0;
  }
  if (greatest > 0 && rotate_by_quaternion(scaled, r)) {
    return 1;
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
