#include "numeric/rotation.h"

#include <math.h>
#include <string.h>

#include "numeric/clones.h"
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

/* A value of each of several matrices. */
typedef double lanes[ORB_ROTATIONS];

/* The symmetric 4×4 matrices of rotate_by_quaternion(), and what their characteristic polynomials need. */
typedef struct quartics {
  lanes a00, a01, a02, a03, a11, a12, a13, a22, a23, a33;
  lanes squares, det, c0;
} quartics;

/* The elements of the adjugate of a symmetric 4×4 matrix, by its 2×2 minors. */
typedef struct adjugate {
  double b00, b01, b02, b03, b11, b12, b13, b22, b23, b33;
} adjugate;

/* shift: is taken from the diagonal. */
static inline adjugate adjugate_of(const quartics *q, int l, double shift) {
  const double a00 = q->a00[l] - shift, a11 = q->a11[l] - shift, a22 = q->a22[l] - shift, a33 = q->a33[l] - shift;
  const double a01 = q->a01[l], a02 = q->a02[l], a03 = q->a03[l], a12 = q->a12[l], a13 = q->a13[l], a23 = q->a23[l];
  const double s0 = a00 * a11 - a01 * a01, s1 = a00 * a12 - a01 * a02, s2 = a00 * a13 - a01 * a03;
  const double s3 = a01 * a12 - a11 * a02, s4 = a01 * a13 - a11 * a03, s5 = a02 * a13 - a12 * a03;
  const double c1 = a02 * a23 - a03 * a22, c2 = a02 * a33 - a03 * a23, c3 = a12 * a23 - a13 * a22;
  const double c4 = a12 * a33 - a13 * a23, c5 = a22 * a33 - a23 * a23;
  return (adjugate){.b00 = a11 * c5 - a12 * c4 + a13 * c3,
                    .b01 = -a01 * c5 + a02 * c4 - a03 * c3,
                    .b02 = a13 * s5 - a23 * s4 + a33 * s3,
                    .b03 = -a12 * s5 + a22 * s4 - a23 * s3,
                    .b11 = a00 * c5 - a02 * c2 + a03 * c1,
                    .b12 = -a03 * s5 + a23 * s2 - a33 * s1,
                    .b13 = a02 * s5 - a22 * s2 + a23 * s1,
                    .b22 = a03 * s4 - a13 * s2 + a33 * s0,
                    .b23 = -a02 * s4 + a12 * s2 - a23 * s0,
                    .b33 = a02 * s3 - a12 * s1 + a22 * s0};
}

static inline double larger(double a, double b) {
  return a > b ? a : b;
}

/* Scales the matrices to elements up to 1 and fills the quartics. */
ORB_CLONES static void rotation_quartics(double h[9][ORB_ROTATIONS], quartics *q) {
  lanes greatest = {0};
  for (int k = 0; k < 9; k++) {
    for (int l = 0; l < ORB_ROTATIONS; l++) {
      greatest[l] = larger(greatest[l], fabs(h[k][l]));
    }
  }
  for (int k = 0; k < 9; k++) {
    for (int l = 0; l < ORB_ROTATIONS; l++) {
      h[k][l] /= greatest[l] > 0 ? greatest[l] : 1;
    }
  }
  for (int l = 0; l < ORB_ROTATIONS; l++) {
    q->a00[l] = h[0][l] + h[4][l] + h[8][l];
    q->a01[l] = h[7][l] - h[5][l];
    q->a02[l] = h[2][l] - h[6][l];
    q->a03[l] = h[3][l] - h[1][l];
    q->a11[l] = h[0][l] - h[4][l] - h[8][l];
    q->a12[l] = h[3][l] + h[1][l];
    q->a13[l] = h[2][l] + h[6][l];
    q->a22[l] = -h[0][l] + h[4][l] - h[8][l];
    q->a23[l] = h[7][l] + h[5][l];
    q->a33[l] = -h[0][l] - h[4][l] + h[8][l];
    q->squares[l] = h[0][l] * h[0][l] + h[1][l] * h[1][l] + h[2][l] * h[2][l] + h[3][l] * h[3][l] + h[4][l] * h[4][l] +
                    h[5][l] * h[5][l] + h[6][l] * h[6][l] + h[7][l] * h[7][l] + h[8][l] * h[8][l];
    q->det[l] = h[0][l] * (h[4][l] * h[8][l] - h[5][l] * h[7][l]) - h[1][l] * (h[3][l] * h[8][l] - h[5][l] * h[6][l]) +
                h[2][l] * (h[3][l] * h[7][l] - h[4][l] * h[6][l]);
    const adjugate b = adjugate_of(q, l, 0);
    q->c0[l] = q->a00[l] * b.b00 + q->a01[l] * b.b01 + q->a02[l] * b.b02 + q->a03[l] * b.b03;
  }
}

/* One Newton step to the greatest eigenvalues. Returns whether one goes on. */
ORB_CLONES static int rotation_newton(const quartics *q, double x[ORB_ROTATIONS]) {
  int goes_on = 0;
  for (int l = 0; l < ORB_ROTATIONS; l++) {
    const double x2 = x[l] * x[l], slope = 4 * x2 * x[l] - 4 * q->squares[l] * x[l] - 8 * q->det[l];
    const double value = x2 * x2 - 2 * q->squares[l] * x2 - 8 * q->det[l] * x[l] + q->c0[l];
    const double step = (slope > 0 ? value : 0) / (slope > 0 ? slope : 1);
    x[l] -= step;
    goes_on |= step > 1e-15 * x[l];
  }
  return goes_on;
}

/* The rotations, 9 rows of lanes. clear: 0 where one is not clear enough. */
ORB_CLONES static void rotation_read(const quartics *q, const double value[ORB_ROTATIONS], double r[9][ORB_ROTATIONS],
                                     double clear[ORB_ROTATIONS]) {
  for (int l = 0; l < ORB_ROTATIONS; l++) {
    const adjugate b = adjugate_of(q, l, value[l]);
    const double d0 = fabs(b.b00), d1 = fabs(b.b11), d2 = fabs(b.b22), d3 = fabs(b.b33);
    const double low = larger(d0, d1), high = larger(d2, d3), greatest = larger(low, high);
    const int upper = low >= high, first = d0 >= d1, third = d2 >= d3;
    const double w = upper ? (first ? b.b00 : b.b01) : (third ? b.b02 : b.b03);
    const double x = upper ? (first ? b.b01 : b.b11) : (third ? b.b12 : b.b13);
    const double y = upper ? (first ? b.b02 : b.b12) : (third ? b.b22 : b.b23);
    const double z = upper ? (first ? b.b03 : b.b13) : (third ? b.b23 : b.b33);
    const double length = w * w + x * x + y * y + z * z, two = 2 / (length > 0 ? length : 1);
    clear[l] = greatest > CLEAR * value[l] * value[l] * value[l] ? 1 : 0;
    r[0][l] = 1 - two * (y * y + z * z);
    r[1][l] = two * (x * y - w * z);
    r[2][l] = two * (x * z + w * y);
    r[3][l] = two * (x * y + w * z);
    r[4][l] = 1 - two * (x * x + z * z);
    r[5][l] = two * (y * z - w * x);
    r[6][l] = two * (x * z - w * y);
    r[7][l] = two * (y * z + w * x);
    r[8][l] = 1 - two * (x * x + y * y);
  }
}

void orb_nearest_rotations(double h[9][ORB_ROTATIONS], int count, double *r) {
  quartics q;
  lanes value, clear;
  double found[9][ORB_ROTATIONS], one[9];
  rotation_quartics(h, &q);
  for (int l = 0; l < ORB_ROTATIONS; l++) {
    value[l] = sqrt(3 * q.squares[l]);
  }
  for (int i = 0; i < STEPS && rotation_newton(&q, value); i++) {
  }
  rotation_read(&q, value, found, clear);
  for (int l = 0; l < count; l++) {
    for (int k = 0; k < 9; k++) {
      one[k] = h[k][l];
    }
    if (clear[l] > 0) {
      for (int k = 0; k < 9; k++) {
        r[9 * l + k] = found[k][l];
      }
    } else { /* also where h is not finite */
      (void)orb_nearest_rotation(one, r + 9 * l);
    }
  }
}
