#include "test/reference/sparse_qr.h"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <SuiteSparseQR.hpp>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace selfcal {
namespace {

using Index = SuiteSparse_long;

Eigen::MatrixXd UpperTriangle(const Eigen::MatrixXd& matrix) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(matrix);
  return qr.matrixQR().topRows(matrix.cols()).triangularView<Eigen::Upper>();
}

}  // namespace

// The Jacobian as CHOLMOD sees it, and what SuiteSparseQR makes of it.
struct SparseQr::Cholmod {
  explicit Cholmod(const SegmentJacobian& jacobian)
      : J(jacobian.J), theta_and_r(J.rows(), jacobian.theta_size + 1) {
    J.makeCompressed();
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
    theta_and_r << J.rightCols(jacobian.theta_size).toDense(), jacobian.r;
    cholmod_l_start(&common);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;
  ~Cholmod() {
    SuiteSparseQR_free(&qr, &common);
    cholmod_l_finish(&common);
  }

  Eigen::SparseMatrix<double, Eigen::ColMajor, Index> J;
  Eigen::MatrixXd theta_and_r;
  cholmod_sparse A = {};
  mutable cholmod_common common;
  SuiteSparseQR_factorization<double>* qr = nullptr;
};

SparseQr::SparseQr(const SegmentJacobian& jacobian, RankDetection detection)
    : cholmod_(std::make_unique<Cholmod>(jacobian)),
      tolerance_(detection == RankDetection::kDefault ? SPQR_DEFAULT_TOL
                                                      : SPQR_NO_TOL),
      theta_size_(jacobian.theta_size) {
  cholmod_->qr = SuiteSparseQR_symbolic<double>(
      SPQR_ORDERING_FIXED,
      /*allow_tol=*/detection == RankDetection::kDefault,
      &cholmod_->A,
      &cholmod_->common);
}

SparseQr::~SparseQr() = default;

void SparseQr::Factorise() {
  SuiteSparseQR_numeric<double>(
      tolerance_, &cholmod_->A, cholmod_->qr, &cholmod_->common);
}

ThetaRoot SparseQr::Root() const {
  // Q^T J = R, so that the last columns of R follow from those of J.
  Eigen::MatrixXd& columns = cholmod_->theta_and_r;
  cholmod_dense b = {};
  b.nrow = b.d = static_cast<std::size_t>(columns.rows());
  b.ncol = static_cast<std::size_t>(columns.cols());
  b.nzmax = b.nrow * b.ncol;
  b.x = columns.data();
  b.xtype = CHOLMOD_REAL;
  b.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* product = SuiteSparseQR_qmult<double>(
      SPQR_QTX, cholmod_->qr, &b, &cholmod_->common);
  const Eigen::Map<const Eigen::MatrixXd> rotated(
      static_cast<const double*>(product->x), columns.rows(), columns.cols());
  const Index first = static_cast<Index>(cholmod_->A.ncol) - theta_size_;
  const Index rows = cholmod_->qr->rank - first;
  ThetaRoot root;
  root.R =
      rotated.block(first, 0, rows, theta_size_).triangularView<Eigen::Upper>();
  root.c = rotated.col(theta_size_).segment(first, rows);
  cholmod_l_free_dense(&product, &cholmod_->common);
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

ReferenceInformation ReferenceDirections(const Rig& rig,
                                         const Eigen::MatrixXd& R) {
  const auto squares = [](const Eigen::MatrixXd& triangle) -> Eigen::VectorXd {
    return Eigen::JacobiSVD<Eigen::MatrixXd>(triangle)
        .singularValues()
        .array()
        .square();
  };
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::Index D = R.cols();
  Eigen::MatrixXd stacked(R.rows() + D, D);
  stacked << R, Eigen::MatrixXd::Identity(D, D);
  ReferenceInformation result;
  // Rows that a deficient R does not have are zero.
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(D, D);
  square.topRows(R.rows()) = R;
  result.whole = squares(square);
  for (const ParameterGroup& group : rig.groups) {
    // The group goes last: the end of the triangle is what is left for it.
    const std::vector<int> last = GroupComponents(rig, group);
    std::vector<int> order(D);
    std::iota(order.begin(), order.end(), 0);
    std::stable_partition(order.begin(), order.end(), [&](int i) {
      return !std::binary_search(last.begin(), last.end(), free[i]);
    });
    const auto k = static_cast<Eigen::Index>(last.size());
    const Eigen::MatrixXd triangle =
        UpperTriangle(stacked(Eigen::all, order)).bottomRightCorner(k, k);
    result.groups.emplace_back(squares(triangle).array() - 1);
  }
  return result;
}

}  // namespace selfcal
