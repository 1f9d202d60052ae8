#include "core/change/compare.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/change/chi_square.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Threshold on Sigma_a + Sigma_b in units of the prior: 2 if neither has more
// information.
constexpr double kKnown = 1.5;
// Convergence tolerance of a solver, in sigmas.
constexpr double kTolerance = 0.05;

// Removes directions of negative information, which occur since the shared
// information is an approximation and may exceed that of one of the two.
MatrixXd Positive(const MatrixXd& information) {
  const SymmetricEigen eigen(information);
  const VectorXd values = eigen.eigenvalues().cwiseMax(0);
  return eigen.eigenvectors() * values.asDiagonal() *
         eigen.eigenvectors().transpose();
}

MatrixXd Inverse(const MatrixXd& Sigma) {
  constexpr double kTiny = 1e-12;  // a component that is known exactly
  const auto size = Sigma.rows();
  const MatrixXd one = MatrixXd::Identity(size, size);
  return (Sigma + kTiny * one).ldlt().solve(one);
}

MatrixXd SharedInformation(const std::vector<SegmentInformation>& shared,
                           const std::vector<int>& free,
                           const VectorXd& prior,
                           Eigen::Index size,
                           double inflation) {
  const auto count = static_cast<Eigen::Index>(free.size());
  MatrixXd sum = MatrixXd::Zero(count, count);
  for (const SegmentInformation& segment : shared) {
    if (segment.Lambda.rows() != size || segment.Lambda.cols() != size ||
        !segment.Lambda.allFinite()) {
      continue;
    }
    const MatrixXd Lambda = segment.Lambda(free, free);
    sum += prior.asDiagonal() * Lambda * prior.asDiagonal() / inflation;
  }
  return Positive(sum);
}

// Cov(b - a), in units of the prior.
MatrixXd DifferenceCovariance(const MatrixXd& Sigma_a,
                              const MatrixXd& Sigma_b,
                              const MatrixXd& Lambda_s) {
  const MatrixXd P = Positive(Inverse(Sigma_a) - Lambda_s);
  const MatrixXd Q = Positive(Inverse(Sigma_b) - Lambda_s);
  const MatrixXd apart = Sigma_a - Sigma_b;
  return apart * Lambda_s * apart + Sigma_a * P * Sigma_a +
         Sigma_b * Q * Sigma_b;
}

ConsistencyTest TestDifference(const VectorXd& delta,
                               const MatrixXd& covariance,
                               const MatrixXd& alone) {
  const SymmetricEigen eigen(alone);
  const auto known = (eigen.eigenvalues().array() < kKnown).count();
  ConsistencyTest test;
  test.degrees = static_cast<int>(known);
  if (known == 0) return test;
  const MatrixXd U = eigen.eigenvectors().leftCols(known);
  const MatrixXd V =
      U.transpose() * (covariance + kTolerance * kTolerance * alone) * U;
  const VectorXd d = U.transpose() * delta;
  test.statistic = std::max(0.0, d.dot(V.ldlt().solve(d)));
  test.probability = ChiSquareTail(test.statistic, test.degrees);
  return test;
}

}  // namespace

CalibrationDifference CompareCalibrations(
    const Rig& rig,
    const KnownCalibration& a,
    const KnownCalibration& b,
    const std::vector<SegmentInformation>& shared) {
  const std::vector<int> free = FreeComponents(rig);
  const VectorXd prior = PriorSigmas(rig)(free);
  const VectorXd scale = prior.cwiseInverse();
  const auto in_prior_units = [&](const MatrixXd& covariance) -> MatrixXd {
    return scale.asDiagonal() * covariance(free, free) * scale.asDiagonal();
  };
  const MatrixXd Sigma_a = in_prior_units(a.covariance);
  const MatrixXd Sigma_b = in_prior_units(b.covariance);
  const double factor =
      std::max({1.0, a.track_noise_factor, b.track_noise_factor});
  CalibrationDifference result;
  result.difference = BoxMinus(b.theta, a.theta);
  const MatrixXd covariance = DifferenceCovariance(
      Sigma_a,
      Sigma_b,
      SharedInformation(
          shared, free, prior, a.covariance.rows(), factor * factor));
  result.sigmas = VectorXd::Zero(result.difference.size());
  result.sigmas(free) =
      covariance.diagonal().cwiseMax(0).cwiseSqrt().cwiseProduct(prior);
  result.test = TestDifference(scale.cwiseProduct(result.difference(free)),
                               covariance,
                               Sigma_a + Sigma_b);
  return result;
}

}  // namespace selfcal
