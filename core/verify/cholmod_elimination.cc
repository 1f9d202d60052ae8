#include "core/verify/cholmod_elimination.h"

// Must precede the headers of CHOLMOD: excludes those of its GPL modules.
#define NSUPERNODAL
#define NMODIFY
#define NMATRIXOPS
#define NPARTITION
#include <cholmod.h>

#include <memory>

namespace selfcal {
namespace {

using SparseRows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

class Cholmod {
 public:
  Cholmod() {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SIMPLICIAL;
    common_.final_ll = 1;
    common_.print = 0;
    // The caller determines the order of the columns.
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_NATURAL;
    common_.postorder = 0;
  }
  ~Cholmod() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;

  // Computes L with L L^T = J^T J; false if there is none.
  bool Factor(const SparseRows& J) {
    // Rows of J are columns of J^T, as CHOLMOD stores a matrix.
    cholmod_sparse A{};
    A.nrow = J.cols();
    A.ncol = J.rows();
    A.nzmax = J.nonZeros();
    A.p = const_cast<int*>(J.outerIndexPtr());
    A.i = const_cast<int*>(J.innerIndexPtr());
    A.x = const_cast<double*>(J.valuePtr());
    A.stype = 0;
    A.itype = CHOLMOD_INT;
    A.xtype = CHOLMOD_REAL;
    A.dtype = CHOLMOD_DOUBLE;
    A.sorted = 1;
    A.packed = 1;
    factor_ = cholmod_analyze(&A, &common_);
    return factor_ != nullptr && cholmod_factorize(&A, factor_, &common_) &&
           common_.status == CHOLMOD_OK && factor_->is_ll &&
           factor_->xtype == CHOLMOD_REAL;
  }

  // L^-1 b; empty if memory runs out.
  Eigen::VectorXd SolveLower(Eigen::VectorXd b) {
    cholmod_dense right{};
    right.nrow = b.size();
    right.ncol = 1;
    right.nzmax = b.size();
    right.d = b.size();
    right.x = b.data();
    right.xtype = CHOLMOD_REAL;
    right.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* solved = cholmod_solve(CHOLMOD_L, factor_, &right, &common_);
    if (solved == nullptr) return {};
    Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(
        static_cast<const double*>(solved->x), b.size());
    cholmod_free_dense(&solved, &common_);
    return y;
  }

  // The lower right corner of L.
  Eigen::MatrixXd Corner(Eigen::Index size) const {
    const auto* begin = static_cast<const int*>(factor_->p);
    const auto* count = static_cast<const int*>(factor_->nz);
    const auto* row = static_cast<const int*>(factor_->i);
    const auto* value = static_cast<const double*>(factor_->x);
    const auto first = static_cast<Eigen::Index>(factor_->n) - size;
    Eigen::MatrixXd L = Eigen::MatrixXd::Zero(size, size);
    for (Eigen::Index j = 0; j < size; ++j) {
      const int at = begin[first + j];
      for (int k = at; k < at + count[first + j]; ++k) {
        L(row[k] - first, j) = value[k];
      }
    }
    return L;
  }

 private:
  cholmod_common common_;
  cholmod_factor* factor_ = nullptr;
};

}  // namespace

std::optional<EliminatedColumns> EliminateByCholmod(const SparseRows& J,
                                                    const Eigen::VectorXd& r,
                                                    Eigen::Index kept) {
  Cholmod cholmod;
  if (!cholmod.Factor(J)) return std::nullopt;
  const Eigen::VectorXd y = cholmod.SolveLower(J.transpose() * r);
  if (y.size() == 0) return std::nullopt;
  const Eigen::MatrixXd L = cholmod.Corner(kept);
  return EliminatedColumns{
      L * L.transpose(),
      -(L * y.tail(kept)),
      r.squaredNorm() - y.head(y.size() - kept).squaredNorm()};
}

}  // namespace selfcal
