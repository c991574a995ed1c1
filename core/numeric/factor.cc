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

using Entry = Eigen::Triplet<double>;

// A block of the context that nobody touches. It stands for memory that Eigen takes for a while.
class Charge {
 public:
  Charge(orb_context *ctx, size_t bytes) : ctx_(ctx), block_(orb_alloc(ctx, bytes, 1)) {
    if (block_ == nullptr) {
      throw std::bad_alloc();
    }
  }
  Charge(const Charge &) = delete;
  Charge &operator=(const Charge &) = delete;
  ~Charge() { orb_free(ctx_, block_); }

 private:
  orb_context *ctx_;
  void *block_;
};

// Bytes of an entry of a sparse matrix, and of an unknown: of the ordering, of permutations and of right sides.
constexpr size_t ENTRY_BYTES = sizeof(double) + sizeof(int), UNKNOWN_BYTES = 128;

// An LDLT that tells how many entries its factor has.
class Solver : public Eigen::SimplicialLDLT<Matrix> {
 public:
  size_t entries() const { return static_cast<size_t>(m_matrix.nonZeros()); }
};

void fill(orb_context *ctx, Matrix *matrix, const orb_coupling *couplings, int64_t count) {
  const int32_t n = static_cast<int32_t>(matrix->rows());
  const size_t entries = 2 * static_cast<size_t>(count) + static_cast<size_t>(n);
  const Charge charge(ctx, entries * (sizeof(Entry) + ENTRY_BYTES));  // of the list, and of its entries by rows
  std::vector<Entry> list;
  list.reserve(entries);
  for (int64_t i = 0; i < count; i++) {
    list.emplace_back(couplings[i].row, couplings[i].column, couplings[i].value);
    list.emplace_back(couplings[i].column, couplings[i].row, couplings[i].value);
  }
  for (int32_t i = 0; i < n; i++) {
    list.emplace_back(i, i, 1);
  }
  matrix->setFromTriplets(list.begin(), list.end());
}

}  // namespace

struct orb_factor {
  Matrix matrix;
  Solver solver;
  void *charged = nullptr;  // a block of the context that nobody touches: it stands for what Eigen keeps
};

extern "C" orb_status orb_factor_create(orb_context *ctx, int32_t n, const orb_coupling *couplings, int64_t count,
                                        orb_factor **out) {
  *out = nullptr;
  try {
    auto factor = std::make_unique<orb_factor>();
    factor->matrix.resize(n, n);
    fill(ctx, &factor->matrix, couplings, count);
    factor->solver.analyzePattern(factor->matrix);  // the factor's memory is not touched before it is computed
    const size_t entries = 2 * static_cast<size_t>(factor->matrix.nonZeros()) + factor->solver.entries();
    factor->charged = orb_alloc(ctx, entries * ENTRY_BYTES + static_cast<size_t>(n) * UNKNOWN_BYTES, 1);
    if (factor->charged == nullptr) {
      return ORB_E_NO_MEMORY;
    }
    *out = factor.release();
    return ORB_OK;
  } catch (const std::exception &) {
    return ORB_E_NO_MEMORY;
  }
}

extern "C" void orb_factor_destroy(orb_context *ctx, orb_factor *factor) {
  if (factor != nullptr) {
    orb_free(ctx, factor->charged);
    delete factor;
  }
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
