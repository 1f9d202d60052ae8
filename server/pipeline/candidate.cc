#include "server/pipeline/candidate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/pipeline/held_out.h"

namespace selfcal::server {
namespace {

// A check whose value may be at most the limit.
void AddCheck(const char* name,
              double value,
              double limit,
              Judgement* judgement) {
  judgement->validation.checks.push_back({name, value, limit, value <= limit});
}

void CheckSolver(const CalibrationResult& result, Judgement* judgement) {
  const bool converged = result.status == CalibrateStatus::kConverged;
  judgement->validation.checks.push_back(
      {"converged", converged ? 1.0 : 0.0, 1.0, converged});
  if (!converged) {
    judgement->reasons.push_back(
        fmt::format("the solver did not converge in {} iterations{}{}",
                    result.iterations,
                    result.message.empty() ? "" : ": ",
                    result.message));
  }
}

// What is wrong with the numbers as such; nothing else can be told then.
std::string NumbersProblem(const Rig& rig, const CalibrationResult& result) {
  const Eigen::Index size = TangentSize(rig.factory);
  if (!SameShape(result.theta, rig.factory) ||
      result.covariance.rows() != size || result.covariance.cols() != size) {
    return "the result does not have the shape of the rig";
  }
  if (!ReadableValues(result.theta).allFinite() ||
      !result.covariance.allFinite()) {
    return "the result has numbers that are not finite";
  }
  if (result.covariance.diagonal().minCoeff() < 0) {
    return "the covariance has a negative variance";
  }
  return "";
}

bool CheckNumbers(const Rig& rig,
                  const CalibrationResult& result,
                  Judgement* judgement) {
  std::vector<std::string> problems;
  const std::string numbers = NumbersProblem(rig, result);
  if (!numbers.empty()) {
    problems.push_back(numbers);
  } else {
    for (const Violation& violation : Validate(result.theta, "")) {
      problems.push_back(
          fmt::format("{}: {}", violation.field, violation.message));
    }
  }
  const bool usable = problems.empty();
  judgement->validation.checks.push_back(
      {"usable", usable ? 1.0 : 0.0, 1.0, usable});
  judgement->reasons.insert(
      judgement->reasons.end(), problems.begin(), problems.end());
  return numbers.empty();
}

void CheckValues(const Rig& rig,
                 const CalibrationResult& result,
                 const CandidateLimits& limits,
                 Judgement* judgement) {
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd change = BoxMinus(result.theta, rig.factory);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  double largest = 0;
  for (const int k : FreeComponents(rig)) {
    const double sigmas = std::abs(change[k]) / prior[k];
    largest = std::max(largest, sigmas);
    if (!(sigmas <= limits.max_prior_sigmas)) {
      judgement->reasons.push_back(fmt::format(
          "{} is {:.1f} prior sigmas from the factory's value, at most {:.1f} "
          "are plausible",
          components[k].name,
          sigmas,
          limits.max_prior_sigmas));
    }
  }
  AddCheck("prior_sigmas", largest, limits.max_prior_sigmas, judgement);
}

void CheckCertainty(const Rig& rig,
                    const StoredCalibration& active,
                    const CalibrationResult& result,
                    const CandidateLimits& limits,
                    Judgement* judgement) {
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const Eigen::VectorXd before = active.covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd after = result.covariance.diagonal().cwiseSqrt();
  double largest = 0;
  for (const int k : FreeComponents(rig)) {
    const double observed = limits.observed_below * prior[k];
    if (!(before[k] < observed && after[k] < observed)) {
      continue;
    }
    largest = std::max(largest, after[k] / before[k]);
    if (after[k] > limits.max_sigma_growth * before[k]) {
      judgement->reasons.push_back(fmt::format(
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
  AddCheck("sigma_growth", largest, limits.max_sigma_growth, judgement);
}

void CheckHeldOut(const Rig& rig,
                  const StoredCalibration& active,
                  const CalibrationResult& result,
                  const std::vector<SegmentInformation>& held_out,
                  const CandidateLimits& limits,
                  Judgement* judgement) {
  const HeldOutTest test =
      TestHeldOut(rig,
                  {result.theta, result.covariance, result.track_noise_factor},
                  {active.theta, active.covariance},
                  held_out);
  judgement->validation.held_out = test;
  const bool passed =
      test.candidate.probability >= limits.min_held_out_probability ||
      test.candidate.probability > test.active.probability;
  judgement->validation.checks.push_back({"held_out_probability",
                                          test.candidate.probability,
                                          limits.min_held_out_probability,
                                          passed});
  if (passed) {
    return;
  }
  judgement->reasons.push_back(fmt::format(
      "{} held-out segments do not fit it: chi-square {:.1f} with {} degrees "
      "(probability {:.1e}, at least {:.1e} is asked for); to active version "
      "{} they fit with {:.1f} (probability {:.1e})",
      test.segments,
      test.candidate.statistic,
      test.candidate.degrees,
      test.candidate.probability,
      limits.min_held_out_probability,
      active.version,
      test.active.statistic,
      test.active.probability));
}

}  // namespace

Judgement JudgeCandidate(const Rig& rig,
                         const StoredCalibration& active,
                         const CalibrationResult& result,
                         const std::vector<SegmentInformation>& held_out,
                         const CandidateLimits& limits) {
  Judgement judgement;
  judgement.validation.active_version = active.version;
  CheckSolver(result, &judgement);
  if (CheckNumbers(rig, result, &judgement)) {
    CheckValues(rig, result, limits, &judgement);
    CheckCertainty(rig, active, result, limits, &judgement);
    CheckHeldOut(rig, active, result, held_out, limits, &judgement);
  }
  return judgement;
}

}  // namespace selfcal::server
