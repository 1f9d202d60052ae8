#include "server/pipeline/candidate_validation.h"

#include <fmt/format.h>

#include <utility>

#include "server/pipeline/candidate_checks.h"

namespace selfcal::server {
namespace {

// What is wrong with the numbers; if anything, nothing else can be checked.
std::string NumbersProblem(const Rig& rig, const CalibrationResult& result) {
  const Eigen::Index size = TangentSize(rig.factory);
  const auto has_size = [&](const Eigen::MatrixXd& matrix) {
    return matrix.rows() == size && matrix.cols() == size;
  };
  if (!SameShape(result.theta, rig.factory) || !has_size(result.covariance) ||
      (result.covariance_of_data.size() > 0 &&
       !has_size(result.covariance_of_data))) {
    return "the result does not have the shape of the rig";
  }
  if (!ReadableValues(result.theta).allFinite() ||
      !result.covariance.allFinite() ||
      !result.covariance_of_data.allFinite()) {
    return "the result has numbers that are not finite";
  }
  if (result.covariance.diagonal().minCoeff() < 0) {
    return "the covariance has a negative variance";
  }
  return "";
}

std::string SolverFailure(const CalibrationResult& result) {
  const std::string message =
      result.message.empty() ? "" : " (" + result.message + ")";
  switch (result.status) {
    case CalibrateStatus::kConverged:
      return "";
    case CalibrateStatus::kStalled:
      return fmt::format(
          "The solver stalled after {} iterations{}: no step lowers the cost, "
          "yet the estimate is not settled, so that its sigmas mean nothing. "
          "Look for segments with large residuals (selfcal segment list), "
          "and send richer motion.",
          result.iterations,
          message);
    default:
      return fmt::format(
          "The solver did not converge in {} iterations{}: the estimate still "
          "moves, so that its sigmas mean nothing. Look for segments with "
          "large residuals (selfcal segment list), and send richer motion.",
          result.iterations,
          message);
  }
}

void CheckSolver(const CalibrationResult& result,
                 std::vector<ValidationCheck>* checks) {
  const bool converged = result.status == CalibrateStatus::kConverged;
  AddResult("converged", converged ? 1 : 0, 1, SolverFailure(result), checks);
}

void CheckNumbers(const Rig& rig,
                  const CalibrationResult& result,
                  std::vector<ValidationCheck>* checks) {
  constexpr char kRemedy[] =
      "No device has such a calibration: check the tolerances of the rig "
      "(prior_sigmas) and whether its segments are of this device.";
  std::string failure = NumbersProblem(rig, result);
  if (failure.empty()) {
    for (const Violation& violation : Validate(result.theta, "")) {
      failure += fmt::format("{}{}: {}",
                             failure.empty() ? "" : "; ",
                             violation.field,
                             violation.message);
    }
  }
  if (!failure.empty()) failure = fmt::format("{}. {}", failure, kRemedy);
  AddResult("usable", failure.empty() ? 1 : 0, 1, failure, checks);
}

}  // namespace

void AddResult(std::string name,
               double value,
               double limit,
               std::string failure,
               std::vector<ValidationCheck>* checks) {
  const CheckOutcome outcome =
      failure.empty() ? CheckOutcome::kPassed : CheckOutcome::kFailed;
  checks->push_back(
      {std::move(name), value, limit, outcome, std::move(failure)});
}

void AddNotTested(std::string name,
                  double limit,
                  std::string sentence,
                  std::vector<ValidationCheck>* checks) {
  checks->push_back({std::move(name),
                     0,
                     limit,
                     CheckOutcome::kNotTested,
                     std::move(sentence)});
}

CandidateValidation ValidateCandidate(const Rig& rig,
                                      const CalibrationResult& result,
                                      const CandidateEvidence& evidence,
                                      const CandidateLimits& limits) {
  CandidateValidation validated;
  StoredValidation& validation = validated.validation;
  validation.active_version = evidence.active.version;
  CheckSolver(result, &validation.checks);
  CheckNumbers(rig, result, &validation.checks);
  if (HasUsableNumbers(rig, result)) {
    const CheckContext context{rig, result, evidence, limits};
    CheckFit(context, &validation.checks);
    CheckEstimate(context, &validation.checks);
    CheckConfirmation(context, &validation);
  }
  bool effects_fail = false;
  for (const ValidationCheck& check : validation.checks) {
    if (check.outcome != CheckOutcome::kFailed) continue;
    validated.reasons.push_back(check.sentence);
    effects_fail = effects_fail || check.name == "effects";
  }
  if (effects_fail && validated.reasons.size() == 1) {
    validated.of_active = EffectOnActive({rig, result, evidence, limits});
  }
  return validated;
}

bool HasUsableNumbers(const Rig& rig, const CalibrationResult& result) {
  return NumbersProblem(rig, result).empty();
}

double UsedNoise(const CalibrationResult& result, NoiseKind kind) {
  for (const NoiseScale& scale : result.noise_scales) {
    if (scale.kind == kind) return scale.used;
  }
  return 1;
}

}  // namespace selfcal::server
