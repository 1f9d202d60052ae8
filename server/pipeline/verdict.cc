#include "server/pipeline/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace selfcal::server {
namespace {

using Sentences = std::vector<std::string>;

// "0.71 imu.accel.scale.x - 0.70 cam0.p_CI.z".
std::string DirectionText(const UnobservedDirection& direction) {
  std::string text;
  for (const UnobservedDirection::Part& part : direction.parts) {
    const char* sign = part.weight < 0 ? "-" : "+";
    if (!text.empty()) {
      text += fmt::format(" {} ", sign);
    } else if (part.weight < 0) {
      text += "-";
    }
    text += fmt::format("{:.2f} {}", std::abs(part.weight), part.component);
  }
  return text.empty() ? "a direction without a name" : text;
}

void AddHeld(const CalibrationResult& result, Sentences* sentences) {
  for (const UnobservedDirection& direction : result.held_constant) {
    sentences->push_back(fmt::format("Not observed, and left as it was: {}.",
                                     DirectionText(direction)));
  }
}

void AddHardlyLearned(const Rig& rig,
                      const CalibrationResult& result,
                      const CandidateLimits& limits,
                      Sentences* sentences) {
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  for (const int k : FreeComponents(rig)) {
    const double sigma = std::sqrt(result.covariance(k, k));
    if (sigma <= limits.observed_below * prior[k]) continue;
    sentences->push_back(
        fmt::format("Hardly learned: {}, sigma {:.2g} {} of {:.2g} before.",
                    components[k].name,
                    sigma,
                    components[k].unit,
                    prior[k]));
  }
}

bool IsMade(const StoredValidation& validation, const std::string& name) {
  return std::any_of(validation.checks.begin(),
                     validation.checks.end(),
                     [&](const ValidationCheck& check) {
                       return check.name == name &&
                              check.outcome != CheckOutcome::kNotTested;
                     });
}

void AddNotMade(const StoredValidation& validation, Sentences* sentences) {
  for (const ValidationCheck& check : validation.checks) {
    if (check.outcome != CheckOutcome::kNotTested) continue;
    const bool replaced =
        check.name == "held_out_probability" && IsMade(validation, "halves");
    if (!replaced) sentences->push_back(check.sentence);
  }
}

// A check that passed, and yet says that errors may be larger than stated.
bool IsDoubt(const ValidationCheck& check) {
  return (check.name == "effects" || check.name == "remembered") &&
         check.outcome == CheckOutcome::kPassed && !check.sentence.empty();
}

void AddDoubts(const StoredValidation& validation, Sentences* sentences) {
  for (const ValidationCheck& check : validation.checks) {
    if (IsDoubt(check)) sentences->push_back(check.sentence);
  }
}

Sentences Notes(const StoredValidation& validation) {
  Sentences notes;
  for (const ValidationCheck& check : validation.checks) {
    if (check.outcome == CheckOutcome::kPassed && !check.sentence.empty() &&
        !IsDoubt(check)) {
      notes.push_back(check.sentence);
    }
  }
  return notes;
}

}  // namespace

Verdict MakeVerdict(const Rig& rig,
                    const CalibrationResult& result,
                    const CandidateValidation& validated,
                    const CandidateLimits& limits) {
  if (!validated.reasons.empty()) {
    return {VerdictKind::kNotTrustworthy, validated.reasons};
  }
  Verdict verdict;
  AddHeld(result, &verdict.sentences);
  AddHardlyLearned(rig, result, limits, &verdict.sentences);
  AddNotMade(validated.validation, &verdict.sentences);
  AddDoubts(validated.validation, &verdict.sentences);
  verdict.kind =
      verdict.sentences.empty() ? VerdictKind::kGood : VerdictKind::kWeak;
  for (std::string& note : Notes(validated.validation)) {
    verdict.sentences.push_back(std::move(note));
  }
  return verdict;
}

Verdict VerdictOf(const StoredCalibration& calibration) {
  if (!calibration.run) {
    return {VerdictKind::kFactory,
            {"These are the values that the rig was created with: nothing was "
             "estimated."}};
  }
  if (calibration.state == CalibrationState::kRejected) {
    return {VerdictKind::kNotTrustworthy, calibration.reasons};
  }
  if (!calibration.finding.empty()) {
    return {VerdictKind::kNotTrustworthy, {calibration.finding}};
  }
  if (calibration.state == CalibrationState::kActive &&
      calibration.changed_since != 0) {
    return {VerdictKind::kNotTrustworthy,
            {fmt::format("The device has changed since (change {}): it is of "
                         "the device before. Record new motion: the next "
                         "version is computed on segments since the change.",
                         calibration.changed_since)}};
  }
  if (calibration.verdict.kind != VerdictKind::kUnknown) {
    return calibration.verdict;
  }
  return {VerdictKind::kUnknown,
          {calibration.state == CalibrationState::kCandidate
               ? "It is not validated yet."
               : "It was validated before there were verdicts; a new "
                 "recalibration gives one."}};
}

std::string VerdictText(VerdictKind kind) {
  switch (kind) {
    case VerdictKind::kUnknown:
      return "unknown";
    case VerdictKind::kGood:
      return "good";
    case VerdictKind::kWeak:
      return "weak";
    case VerdictKind::kNotTrustworthy:
      return "not trustworthy";
    case VerdictKind::kFactory:
      return "factory";
  }
  return "unknown";
}

}  // namespace selfcal::server
