#include "transfer/rotation.h"

#include <math.h>
#include <string.h>

#include "numeric/vec3.h"

enum { SWEEPS = 24 }; /* of Jacobi rotations: they converge quadratically, so that a few are usual */
/* Sum of the squares off the diagonal, in units of the largest entry's square: eigenvectors are then exact to rounding.
 */
static const double CONVERGED = 1e-30;
static const double NO_ANGLE = 1e-12; /* radians: such a rotation moves a unit vector by rounding only */
static const double NO_SINE = 1e-15;  /* of half the angle: below it, the axis is rounding */

/* One Jacobi rotation that makes m[p][q] zero; v collects the eigenvectors in its columns. */
static void jacobi_rotate(double m[4][4], double v[4][4], int p, int q) {
  if (m[p][q] == 0) {
    return;
  }
  double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
  double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
  double c = 1 / sqrt(t * t + 1), s = t * c;
  for (int k = 0; k < 4; k++) {
    double a = m[k][p], b = m[k][q];
    m[k][p] = c * a - s * b;
    m[k][q] = s * a + c * b;
  }
  for (int k = 0; k < 4; k++) {
    double a = m[p][k], b = m[q][k];
    m[p][k] = c * a - s * b;
    m[q][k] = s * a + c * b;
    a = v[k][p];
    b = v[k][q];
    v[k][p] = c * a - s * b;
    v[k][q] = s * a + c * b;
  }
}

void orb_rotation_fit(double h[3][3], double q[4]) {
  double scale = 0;
  for (int i = 0; i < 9; i++) {
    scale = fmax(scale, fabs(h[i / 3][i % 3]));
  }
  q[0] = 1;
  q[1] = q[2] = q[3] = 0;
  if (!(scale > 0) || !isfinite(scale)) {
    return;
  }
  double xx = h[0][0] / scale, xy = h[0][1] / scale, xz = h[0][2] / scale;
  double yx = h[1][0] / scale, yy = h[1][1] / scale, yz = h[1][2] / scale;
  double zx = h[2][0] / scale, zy = h[2][1] / scale, zz = h[2][2] / scale;
  double m[4][4] = {{xx + yy + zz, yz - zy, zx - xz, xy - yx},
                    {yz - zy, xx - yy - zz, xy + yx, zx + xz},
                    {zx - xz, xy + yx, yy - xx - zz, yz + zy},
                    {xy - yx, zx + xz, yz + zy, zz - xx - yy}};
  double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  for (int sweep = 0; sweep < SWEEPS; sweep++) {
    double off = 0;
    for (int i = 0; i < 4; i++) {
      for (int j = i + 1; j < 4; j++) {
        off += m[i][j] * m[i][j];
      }
    }
    if (off < CONVERGED) {
      break;
    }
    for (int i = 0; i < 4; i++) {
      for (int j = i + 1; j < 4; j++) {
        jacobi_rotate(m, v, i, j);
      }
    }
  }
  int best = 0;
  for (int i = 1; i < 4; i++) {
    best = m[i][i] > m[best][best] ? i : best;
  }
  double sign = v[0][best] < 0 ? -1 : 1, length = 0;
  for (int i = 0; i < 4; i++) {
    q[i] = sign * v[i][best];
    length += q[i] * q[i];
  }
  for (int i = 0; i < 4; i++) {
    q[i] /= sqrt(length);
  }
}

void orb_rotation_vector(double h[3][3], double out[3]) {
  double q[4];
  orb_rotation_fit(h, q);
  double sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), angle = 2 * atan2(sine, q[0]);
  for (int k = 0; k < 3; k++) {
    out[k] = sine > NO_SINE ? angle * q[k + 1] / sine : 0;
  }
}

void orb_rotate_by(const double w[3], double t, const double v[3], double out[3]) {
  double angle = orb_length(w) * t, axis[3] = {w[0], w[1], w[2]}, cross[3];
  if (!(orb_normalize(axis) > NO_ANGLE)) {
    memcpy(out, v, 3 * sizeof *out);
    return;
  }
  double s = sin(angle), c = cos(angle), along = orb_dot(axis, v) * (1 - c);
  orb_cross(axis, v, cross);
  for (int k = 0; k < 3; k++) {
    out[k] = c * v[k] + s * cross[k] + along * axis[k];
  }
}

void orb_rotation_matrix(const double q[4], double out[3][3]) {
  double w = q[0], x = q[1], y = q[2], z = q[3];
  out[0][0] = 1 - 2 * (y * y + z * z);
  out[0][1] = 2 * (x * y - w * z);
  out[0][2] = 2 * (x * z + w * y);
  out[1][0] = 2 * (x * y + w * z);
  out[1][1] = 1 - 2 * (x * x + z * z);
  out[1][2] = 2 * (y * z - w * x);
  out[2][0] = 2 * (x * z - w * y);
  out[2][1] = 2 * (y * z + w * x);
  out[2][2] = 1 - 2 * (x * x + y * y);
}
