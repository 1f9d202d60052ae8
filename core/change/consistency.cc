#include "core/change/consistency.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/change/chi_square.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

// Ratio of the standard deviation of the unknown error of a segment to its
// reach. Errors of simulated rotations in place are up to one and a half times
// the reach.
constexpr double kReachError = 2.0;

// Observed eigenvectors of a symmetric matrix, with their eigenvalues.
struct Observed {
  explicit Observed(const Eigen::MatrixXd& information) {
    const SymmetricEigen eigen(information);
    const auto count = (eigen.eigenvalues().array() >= kObserved).count();
    values = eigen.eigenvalues().tail(count);
    directions = eigen.eigenvectors().rightCols(count);
  }
  Eigen::VectorXd values;
  Eigen::MatrixXd directions;
};

ConsistencyTest TestNormal(const Eigen::VectorXd& delta,
                           const Eigen::MatrixXd& covariance) {
  ConsistencyTest test;
  test.degrees = static_cast<int>(delta.size());
  if (test.degrees == 0) return test;
  test.statistic = std::max(0.0, delta.dot(covariance.ldlt().solve(delta)));
  test.probability = ChiSquareTail(test.statistic, test.degrees);
  return test;
}

}  // namespace

OffsetInformation& OffsetInformation::operator+=(
    const OffsetInformation& other) {
  Lambda += other.Lambda;
  eta += other.eta;
  if (reach.size() == 0) {
    reach = other.reach;
  } else if (other.reach.size() > 0) {
    reach = reach.cwiseMax(other.reach);
  }
  return *this;
}

OffsetInformation& OffsetInformation::operator-=(
    const OffsetInformation& other) {
  Lambda -= other.Lambda;
  eta -= other.eta;
  return *this;
}

ConsistencyTester::ConsistencyTester(const Rig& rig,
                                     const KnownCalibration& active,
                                     std::optional<double> inflation)
    : theta_(active.theta),
      inflation_(inflation.value_or(
          std::pow(std::max(1.0, active.track_noise_factor), 2))),
      free_(FreeComponents(rig)),
      prior_(PriorSigmas(rig)(free_)),
      reference_(ReferenceSigmas(rig)(free_)),
      parts_(ThetaParts(rig)),
      groups_(GroupParts(rig)) {
  const Eigen::VectorXd scale = prior_.cwiseInverse();
  Sigma_ =
      scale.asDiagonal() * active.covariance(free_, free_) * scale.asDiagonal();
  const SymmetricEigen eigen(Sigma_);
  root_ = eigen.eigenvectors() *
          eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
}

bool ConsistencyTester::Accepts(const SegmentInformation& information) const {
  const int size = TangentSize(theta_);
  if (information.residuals.many_outliers ||
      !SameShape(information.theta0, theta_) ||
      information.Lambda.rows() != size || information.Lambda.cols() != size ||
      information.eta.size() != size || !information.Lambda.allFinite() ||
      !information.eta.allFinite()) {
    return false;
  }
  const Eigen::VectorXd offset = BoxMinus(information.theta0, theta_)(free_);
  return (offset.cwiseAbs().array() <= kMaxLinearisation * reference_.array())
      .all();
}

OffsetInformation ConsistencyTester::Offset(
    const SegmentInformation& information) const {
  const Eigen::MatrixXd Lambda = information.Lambda(free_, free_);
  const Eigen::VectorXd at = BoxMinus(information.theta0, theta_)(free_);
  const Eigen::VectorXd eta = information.eta(free_) + Lambda * at;
  OffsetInformation offset{
      prior_.asDiagonal() * Lambda * prior_.asDiagonal() / inflation_,
      prior_.cwiseProduct(eta) / inflation_};
  if (!at.isZero(0)) {
    offset.reach = kReachError * at.cwiseAbs().cwiseQuotient(prior_);
  }
  return offset;
}

Eigen::MatrixXd ConsistencyTester::Covariance(
    const OffsetInformation& offset) const {
  Eigen::MatrixXd covariance = Sigma_;
  if (offset.reach.size() > 0) {
    covariance.diagonal() += offset.reach.cwiseAbs2();
  }
  return covariance;
}

ConsistencyTest ConsistencyTester::Test(const OffsetInformation& offset) const {
  const Observed observed(offset.Lambda);
  const Eigen::MatrixXd& U = observed.directions;
  const Eigen::VectorXd variances = observed.values.cwiseInverse();
  const Eigen::VectorXd delta =
      variances.cwiseProduct(U.transpose() * offset.eta);
  Eigen::MatrixXd covariance = U.transpose() * Covariance(offset) * U;
  covariance.diagonal() += variances;
  return TestNormal(delta, covariance);
}

// The rig's prior about the active calibration is added, so that directions
// that the segment does not observe can be marginalised:
//   delta = K eta, K = (Lambda + 1)^-1, eta ~ N(0, Lambda + Lambda Sigma
//   Lambda)
// The distribution without a change is exact despite this prior.
std::vector<GroupConsistency> ConsistencyTester::TestGroups(
    const OffsetInformation& offset) const {
  const Eigen::Index size = offset.eta.size();
  const Eigen::MatrixXd& Lambda = offset.Lambda;
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(size, size);
  const Eigen::MatrixXd K = (Lambda + one).ldlt().solve(one);
  const Eigen::VectorXd delta = K * offset.eta;
  const Eigen::MatrixXd covariance =
      K * (Lambda + Lambda * Covariance(offset) * Lambda) * K.transpose();
  std::vector<GroupConsistency> tests;
  for (const ThetaPart& group : groups_) {
    const auto k = static_cast<Eigen::Index>(group.at.size());
    const Eigen::MatrixXd posterior = K(group.at, group.at);
    const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(k, k);
    const Observed observed(posterior.ldlt().solve(identity) - identity);
    const Eigen::MatrixXd& V = observed.directions;
    tests.push_back(
        {group.name,
         TestNormal(V.transpose() * delta(group.at),
                    V.transpose() * covariance(group.at, group.at) * V)});
  }
  return tests;
}

}  // namespace selfcal
