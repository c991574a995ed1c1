// With D = diag(mass)^(-1/2), the eigenpairs of K x = λ M x are those of D K D y = λ y, x = D y. With a shift below 0
// that matrix is positive definite, and its inverse has the same eigenvectors in reverse order, with eigenvalues that
// lie well apart.
#define EIGEN_MPL2_ONLY  // only the parts of Eigen that are under the MPL 2.0

#include "spectral/eigen.h"

#include <cmath>
#include <exception>
#include <new>
#include <vector>

#include <Spectra/SymEigsShiftSolver.h>
#include <Eigen/SparseCholesky>

#include "base/error.h"

namespace {

using Matrix = Eigen::SparseMatrix<double>;
using Vector = Eigen::VectorXd;

constexpr double tolerance = 1e-9;
constexpr int restarts = 60;

// The operator that Spectra expects: y = (S - shift)^-1 x.
class Inverse {
 public:
  using Scalar = double;

  explicit Inverse(const Matrix &given) : matrix(given) {}

  Eigen::Index rows() const { return matrix.rows(); }

  Eigen::Index cols() const { return matrix.cols(); }

  void set_shift(double shift) {
    Matrix identity(matrix.rows(), matrix.cols());
    identity.setIdentity();
    factor.compute(matrix - shift * identity);
  }

  void perform_op(const double *x, double *y) const {
    Eigen::Map<const Vector> in(x, matrix.rows());
    Eigen::Map<Vector> out(y, matrix.rows());
    out.noalias() = factor.solve(in);
  }

 private:
  const Matrix &matrix;
  Eigen::SimplicialLDLT<Matrix> factor;
};

bool solve(int32_t n, const orb_entry *entries, int64_t count, const double *mass, int32_t wanted, double *values,
           double *vectors) {
  std::vector<Eigen::Triplet<double>> list;
  list.reserve(static_cast<size_t>(count));
  double trace = 0;
  for (int64_t i = 0; i < count; i++) {
    const orb_entry &e = entries[i];
    double value = e.value / std::sqrt(mass[e.row] * mass[e.column]);
    trace += e.row == e.column ? value : 0;
    list.emplace_back(e.row, e.column, value);
  }
  if (!std::isfinite(trace) || !(trace > 0)) {
    return false;
  }
  Matrix matrix(n, n);
  matrix.setFromTriplets(list.begin(), list.end());
  Inverse inverse(matrix);
  Vector start(n);
  for (int32_t v = 0; v < n; v++) {  // not an eigenvector, and nearly orthogonal to none
    start[v] = std::sqrt(mass[v]) * (1 + 0.5 * std::sin(12.9898 * (v + 1)));
  }
  // The shift is small compared with the wanted eigenvalues: number i is near 4 π i / area (Weyl 1911).
  double area = 0;
  for (int32_t v = 0; v < n; v++) {
    area += mass[v];
  }
  Spectra::SymEigsShiftSolver<Inverse> solver(inverse, wanted, std::min(n, 2 * wanted + 20), -0.2 / area);
  solver.init(start.data());
  if (solver.compute(Spectra::SortRule::LargestMagn, restarts, tolerance, Spectra::SortRule::SmallestAlge) < wanted) {
    return false;
  }
  Vector lowest = solver.eigenvalues();
  Eigen::MatrixXd columns = solver.eigenvectors();
  for (int32_t k = 0; k < wanted; k++) {
    values[k] = lowest[k];
    for (int32_t v = 0; v < n; v++) {
      vectors[static_cast<size_t>(k) * n + v] = columns(v, k) / std::sqrt(mass[v]);
    }
  }
  return std::isfinite(columns.sum()) && std::isfinite(lowest.sum());
}

}  // namespace

extern "C" orb_status orb_eigen_lowest(orb_context *ctx, int32_t n, const orb_entry *entries, int64_t count,
                                       const double *mass, int32_t wanted, double *values, double *vectors,
                                       int *found) {
  try {
    *found = solve(n, entries, count, mass, wanted, values, vectors);
    return ORB_OK;
  } catch (const std::bad_alloc &) {
    return ORB_E_NO_MEMORY;
  } catch (const std::exception &) {  // Spectra throws where its own small problems do not converge
    *found = 0;
    return orb_context_check(ctx);
  }
}
