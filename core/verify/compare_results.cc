#include "core/verify/compare_results.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

namespace selfcal {
namespace {

std::string WhyIncomparable(const CalibrationResult& a,
                            const CalibrationResult& b) {
  for (const CalibrationResult* result : {&a, &b}) {
    if (result->status == CalibrateStatus::kConverged) continue;
    return result->message.empty()
               ? "a solver did not converge"
               : "a solver did not converge: " + result->message;
  }
  if (a.rank != b.rank) {
    return "the solvers estimate " + std::to_string(a.rank) + " and " +
           std::to_string(b.rank) + " directions";
  }
  if (a.segments != b.segments) {
    return "the solvers use " + std::to_string(a.segments) + " and " +
           std::to_string(b.segments) + " segments";
  }
  if (a.remembered.segments != b.remembered.segments) {
    return "the results are completed by " +
           std::to_string(a.remembered.segments) + " and " +
           std::to_string(b.remembered.segments) + " segments without data";
  }
  return "";
}

// NaN exceeds everything else, and nothing exceeds NaN.
bool Exceeds(double value, double most) {
  return std::isnan(value) || value > most;
}

}  // namespace

ResultDifference CompareResults(const Rig& rig,
                                const CalibrationResult& a,
                                const CalibrationResult& b) {
  ResultDifference difference;
  difference.incomparable = WhyIncomparable(a, b);
  if (!difference.incomparable.empty()) return difference;
  const std::vector<TangentComponent> components =
      TangentComponents(rig.factory);
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd by = BoxMinus(b.theta, a.theta);
  for (const int i : free) {
    const double sigma = std::sqrt(a.covariance(i, i));
    const double theta_sigmas = std::abs(by(i)) / sigma;
    if (Exceeds(theta_sigmas, difference.theta_sigmas)) {
      difference.theta_sigmas = theta_sigmas;
      difference.theta_component = components[i].name;
    }
    const double by_sigma = std::abs(std::sqrt(b.covariance(i, i)) / sigma - 1);
    if (Exceeds(by_sigma, difference.sigma)) {
      difference.sigma = by_sigma;
      difference.sigma_component = components[i].name;
    }
  }
  if (free.empty()) return difference;
  const Eigen::VectorXd unit = PriorSigmas(rig)(free).cwiseInverse();
  const auto scaled = [&](const Eigen::MatrixXd& covariance) {
    return Eigen::MatrixXd(unit.asDiagonal() * covariance(free, free) *
                           unit.asDiagonal());
  };
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ratio(
      scaled(b.covariance), scaled(a.covariance), Eigen::EigenvaluesOnly);
  difference.covariance =
      (ratio.eigenvalues().cwiseMax(0).cwiseSqrt().array() - 1)
          .abs()
          .maxCoeff();
  return difference;
}

bool IsConvergence(const ResultDifference& difference) {
  return !difference.incomparable.empty() ||
         (difference.theta_sigmas <= kThetaTolerance_sigmas &&
          difference.sigma <= kSigmaTolerance);
}

}  // namespace selfcal
