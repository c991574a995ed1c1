#define EIGEN_MPL2_ONLY  // only the parts of Eigen that are under the MPL 2.0

#include "numeric/factor.h"

#include <exception>
#include <memory>
#include <new>
#include <vector>

#include <Eigen/SparseCholesky>

namespace {

using Matrix = Eigen::SparseMatrix<double>;
using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;

}  // namespace

struct orb_factor {
  Matrix matrix;
  Eigen::SimplicialLDLT<Matrix> solver;
};

extern "C" orb_status orb_factor_create(int32_t n, const orb_coupling *couplings, int64_t count, orb_factor **out) {
  *out = nullptr;
  try {
    auto factor = std::make_unique<orb_factor>();
    std::vector<Eigen::Triplet<double>> list;
    list.reserve(2 * static_cast<size_t>(count) + static_cast<size_t>(n));
    for (int64_t i = 0; i < count; i++) {
      list.emplace_back(couplings[i].row, couplings[i].column, couplings[i].value);
      list.emplace_back(couplings[i].column, couplings[i].row, couplings[i].value);
    }
    for (int32_t i = 0; i < n; i++) {
      list.emplace_back(i, i, 1);
    }
    factor->matrix.resize(n, n);
    factor->matrix.setFromTriplets(list.begin(), list.end());
    factor->solver.analyzePattern(factor->matrix);
    *out = factor.release();
    return ORB_OK;
  } catch (const std::exception &) {
    return ORB_E_NO_MEMORY;
  }
}

extern "C" void orb_factor_destroy(orb_factor *factor) {
  delete factor;
}

extern "C" orb_status orb_factor_compute(orb_factor *factor, const double *diagonal) {
  try {
    for (Eigen::Index i = 0; i < factor->matrix.rows(); i++) {
      factor->matrix.coeffRef(i, i) = diagonal[i];
    }
    factor->solver.factorize(factor->matrix);
  } catch (const std::exception &) {
    return ORB_E_NO_MEMORY;
  }
  return factor->solver.info() == Eigen::Success ? ORB_OK : ORB_E_INTERNAL;
}

extern "C" void orb_factor_solve3(const orb_factor *factor, const double *right, double *x) {
  const Eigen::Index n = factor->matrix.rows();
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
  Eigen::Map<const Rows> b(right, n, 3);
  Eigen::Map<Rows> out(x, n, 3);
  Columns in = b;
  out = factor->solver.solve(in);
}
