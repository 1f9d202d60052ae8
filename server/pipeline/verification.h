// Results of a verification: a score or a calibration is computed by both
// cores, the structured one and Ceres (core/verify), and compared.
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
  int segments = 0;       // solved by both
  int segments_gone = 0;  // of the version, without data
  std::string message;    // why it was not compared
};

struct Verification {
  std::int64_t version = 0;  // the active one
  std::vector<ScoreCheck> scores;
  // nullopt if the factory calibration is active, which no core has computed.
  std::optional<CalibrationCheck> calibration;
};

// Progress of a verification: what it does now, and the latest result, if any.
struct VerificationStep {
  int done = 0;  // of the scores and the calibration
  int total = 0;
  std::string subject;
  const ScoreCheck* score = nullptr;
  const CalibrationCheck* calibration = nullptr;
};
using OnVerificationStep = std::function<void(const VerificationStep&)>;

// The reason not to trust the version, in a sentence: the calibration or scores
// that differ, with the largest difference. Empty if none does.
std::string DisagreementText(const Verification& verification);

}  // namespace selfcal::server
