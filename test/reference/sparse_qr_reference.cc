#include "test/reference/sparse_qr_reference.h"

#include <Eigen/QR>
#include <SuiteSparseQR.hpp>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace selfcal {
namespace {

using Index = SuiteSparse_long;

// Owns what CHOLMOD and SPQR allocate.
class Cholmod {
 public:
  Cholmod() { cholmod_l_start(&common_); }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;
  ~Cholmod() {
    cholmod_l_free_sparse(&R, &common_);
    cholmod_l_free_dense(&C, &common_);
    cholmod_l_finish(&common_);
  }
  cholmod_common* common() { return &common_; }

  cholmod_sparse* R = nullptr;
  cholmod_dense* C = nullptr;

 private:
  cholmod_common common_;
};

Eigen::MatrixXd UpperTriangle(const Eigen::MatrixXd& matrix) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(matrix);
  return qr.matrixQR().topRows(matrix.cols()).triangularView<Eigen::Upper>();
}

}  // namespace

ThetaRoot SparseQrReference(const SegmentJacobian& jacobian) {
  Eigen::SparseMatrix<double, Eigen::ColMajor, Index> J = jacobian.J;
  Eigen::VectorXd r = jacobian.r;
  J.makeCompressed();
  cholmod_sparse A = {};
  A.nrow = static_cast<std::size_t>(J.rows());
  A.ncol = static_cast<std::size_t>(J.cols());
  A.nzmax = static_cast<std::size_t>(J.nonZeros());
  A.p = J.outerIndexPtr();
  A.i = J.innerIndexPtr();
  A.x = J.valuePtr();
  A.itype = CHOLMOD_LONG;
  A.xtype = CHOLMOD_REAL;
  A.dtype = CHOLMOD_DOUBLE;
  A.sorted = 1;
  A.packed = 1;
  cholmod_dense b = {};
  b.nrow = b.nzmax = b.d = A.nrow;
  b.ncol = 1;
  b.x = r.data();
  b.xtype = CHOLMOD_REAL;
  b.dtype = CHOLMOD_DOUBLE;

  Cholmod cholmod;
  Index* permutation = nullptr;  // none: the order of the columns is given
  const Index rank = SuiteSparseQR<double>(SPQR_ORDERING_FIXED,
                                           SPQR_DEFAULT_TOL,
                                           static_cast<Index>(A.ncol),
                                           &A,
                                           &b,
                                           &cholmod.C,
                                           &cholmod.R,
                                           &permutation,
                                           cholmod.common());
  const Index first = static_cast<Index>(A.ncol) - jacobian.theta_size;
  ThetaRoot root;
  root.R = Eigen::MatrixXd::Zero(rank - first, jacobian.theta_size);
  const auto* p = static_cast<const Index*>(cholmod.R->p);
  const auto* i = static_cast<const Index*>(cholmod.R->i);
  const auto* x = static_cast<const double*>(cholmod.R->x);
  for (int j = 0; j < jacobian.theta_size; ++j) {
    for (Index n = p[first + j]; n < p[first + j + 1]; ++n) {
      if (i[n] >= first && i[n] < rank) root.R(i[n] - first, j) = x[n];
    }
  }
  root.c = Eigen::Map<const Eigen::VectorXd>(
      static_cast<const double*>(cholmod.C->x) + first, rank - first);
  return root;
}

std::vector<double> ReferenceEntropies(const Rig& rig,
                                       const Eigen::MatrixXd& R) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const Eigen::VectorXd reference = ReferenceSigmas(rig);
  const Eigen::Index D = R.cols();
  Eigen::MatrixXd stacked(R.rows() + D, D);
  stacked << R, Eigen::MatrixXd::Identity(D, D);
  // Rows of the inverse are a square root of the covariance.
  const Eigen::MatrixXd root =
      UpperTriangle(stacked).triangularView<Eigen::Upper>().solve(
          Eigen::MatrixXd::Identity(D, D));
  std::vector<double> entropies;
  for (const ParameterGroup& group : rig.groups) {
    const std::vector<int> components = GroupComponents(rig, group);
    const auto k = static_cast<Eigen::Index>(components.size());
    Eigen::MatrixXd rows(k, D);
    for (Eigen::Index n = 0; n < k; ++n) {
      const int c = components[n];
      const auto at = std::lower_bound(free.begin(), free.end(), c);
      rows.row(n) = root.row(at - free.begin()) * (prior(c) / reference(c));
    }
    const Eigen::MatrixXd triangle = UpperTriangle(rows.transpose());
    entropies.push_back(0.5 * static_cast<double>(k) *
                            std::log(2 * std::numbers::pi * std::numbers::e) +
                        triangle.diagonal().cwiseAbs().array().log().sum());
  }
  return entropies;
}

}  // namespace selfcal
