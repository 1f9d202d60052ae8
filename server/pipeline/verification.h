// What comes of computing a score or a calibration by both cores, the
// structured one and Ceres (core/verify), and comparing them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/model/segment.h"
#include "core/verify/compare_results.h"
#include "core/verify/compare_scores.h"

namespace selfcal::server {

enum class VerificationOutcome {
  kAgrees,
  kDiffers,  // by more than rounding or convergence explains
  kNotCompared,
};

struct ScoreCheck {
  SegmentKey segment;
  VerificationOutcome outcome = VerificationOutcome::kNotCompared;
  ScoreDifference difference;
  std::string message;  // why it was not compared
};

struct CalibrationCheck {
  std::int64_t version = 0;
  VerificationOutcome outcome = VerificationOutcome::kNotCompared;
  ResultDifference difference;
  int segments = 0;       // that both solved
  int segments_gone = 0;  // of the version, whose data is not kept any more
  std::string message;    // why it was not compared
};

struct Verification {
  std::int64_t version = 0;  // that was active
  std::vector<ScoreCheck> scores;
  // None where the factory's version is active: no core has computed it.
  std::optional<CalibrationCheck> calibration;
};

// What a verification does now, and what it has just found, if anything.
struct VerificationStep {
  int done = 0;  // of the scores and the calibration
  int total = 0;
  std::string subject;
  const ScoreCheck* score = nullptr;
  const CalibrationCheck* calibration = nullptr;
};
using OnVerificationStep = std::function<void(const VerificationStep&)>;

// What makes the version one that is not to be trusted, in a sentence: the
// calibration or scores that differ, with the largest difference. Empty where
// none does.
std::string Finding(const Verification& verification);

}  // namespace selfcal::server
