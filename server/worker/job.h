// Serialisation of the input and result of a calibration or a score, for a
// worker (proto/selfcal/worker/job.proto). Doubles are exact, bit for bit.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <string_view>

#include "core/calibration/calibrate.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/verify/scorer.h"
#include "server/worker/worker.h"

namespace selfcal::server {

// A task for the segments, which follow one by one.
struct Job {
  Rig rig;
  Calibration theta_start;
  CalibrateOptions options;
  WorkerLimits limits;
  // If set, the job is to score one segment at theta_start; otherwise it
  // is a calibration.
  std::optional<ScorerKind> scorer = std::nullopt;
};

std::string EncodeJob(const Job& job);
std::string EncodeSegment(const MotionSegment& segment);
std::string EncodeProgress(const CalibrateProgress& progress);
// A failed result keeps only its message; any other keeps what the record of a
// calibration has, and Lambda.
std::string EncodeResult(const CalibrationResult& result);
std::string EncodeScore(const SegmentInformation& information);

// Return nullopt if the bytes are not from the functions above.
std::optional<Job> DecodeJob(std::string_view bytes);
std::optional<MotionSegment> DecodeSegment(std::string_view bytes);
std::optional<CalibrateProgress> DecodeProgress(std::string_view bytes);
std::optional<CalibrationResult> DecodeResult(std::string_view bytes);

// INTERNAL with the failure that was passed to EncodeResult(), or if the bytes
// are not from EncodeScore().
absl::StatusOr<SegmentInformation> DecodeScore(std::string_view bytes);

}  // namespace selfcal::server
