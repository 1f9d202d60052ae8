#include "server/pipeline/candidate.h"

#include <fmt/format.h>

#include <cmath>

namespace selfcal::server {
namespace {

void CheckSolver(const CalibrationResult& result,
                 std::vector<std::string>* problems) {
  if (result.status != CalibrateStatus::kConverged) {
    problems->push_back(
        fmt::format("the solver did not converge in {} iterations{}{}",
                    result.iterations,
                    result.message.empty() ? "" : ": ",
                    result.message));
  }
}

bool CheckNumbers(const Rig& rig,
                  const CalibrationResult& result,
                  std::vector<std::string>* problems) {
  const Eigen::Index size = TangentSize(rig.factory);
  if (!SameShape(result.theta, rig.factory) ||
      result.covariance.rows() != size || result.covariance.cols() != size) {
    problems->push_back("the result does not have the shape of the rig");
    return false;
  }
  if (!ReadableValues(result.theta).allFinite() ||
      !result.covariance.allFinite()) {
    problems->push_back("the result has numbers that are not finite");
    return false;
  }
  if (result.covariance.diagonal().minCoeff() < 0) {
    problems->push_back("the covariance has a negative variance");
    return false;
  }
  return true;
}

void CheckValues(const Rig& rig,
                 const CalibrationResult& result,
                 const CandidateLimits& limits,
                 std::vector<std::string>* problems) {
  for (const Violation& violation : Validate(result.theta, "")) {
    problems->push_back(
        fmt::format("{}: {}", violation.field, violation.message));
  }
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd change = BoxMinus(result.theta, rig.factory);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  for (const int k : FreeComponents(rig)) {
    const double sigmas = std::abs(change[k]) / prior[k];
    if (!(sigmas <= limits.max_prior_sigmas)) {
      problems->push_back(fmt::format(
          "{} is {:.1f} prior sigmas from the factory's value, at most {:.1f} "
          "are plausible",
          components[k].name,
          sigmas,
          limits.max_prior_sigmas));
    }
  }
}

void CheckCertainty(const Rig& rig,
                    const StoredCalibration& active,
                    const CalibrationResult& result,
                    const CandidateLimits& limits,
                    std::vector<std::string>* problems) {
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const Eigen::VectorXd before = active.covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd after = result.covariance.diagonal().cwiseSqrt();
  for (const int k : FreeComponents(rig)) {
    const double observed = limits.observed_below * prior[k];
    if (before[k] < observed && after[k] < observed &&
        after[k] > limits.max_sigma_growth * before[k]) {
      problems->push_back(fmt::format(
          "the sigma of {} is {:.3g} {}, that of active version {} is {:.3g}: "
          "at most {:.1f} times as much may become active",
          components[k].name,
          after[k],
          components[k].unit,
          active.version,
          before[k],
          limits.max_sigma_growth));
    }
  }
}

}  // namespace

std::vector<std::string> CandidateProblems(const Rig& rig,
                                           const StoredCalibration& active,
                                           const CalibrationResult& result,
                                           const CandidateLimits& limits) {
  std::vector<std::string> problems;
  CheckSolver(result, &problems);
  if (CheckNumbers(rig, result, &problems)) {
    CheckValues(rig, result, limits, &problems);
    CheckCertainty(rig, active, result, limits, &problems);
  }
  return problems;
}

}  // namespace selfcal::server
