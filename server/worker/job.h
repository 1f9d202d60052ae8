// Serialisation of the input and result of a calibration or a score, for a
// worker (proto/selfcal/worker/job.proto). Doubles are exact, bit for bit.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/verify/scorer.h"
#include "server/worker/worker.h"

namespace selfcal::server {

struct Job {
  Rig rig;
  Calibration theta_start;
  std::vector<MotionSegment> segments;
  CalibrateOptions options;
  WorkerLimits limits;
  // If set, the job is to score the only segment at theta_start; otherwise it
  // is a calibration.
  std::optional<ScorerKind> scorer = std::nullopt;
};

// Returns an empty string if the job exceeds the size of a message (2 GiB).
std::string EncodeJob(const Rig& rig,
                      const Calibration& theta_start,
                      const std::vector<MotionSegment>& segments,
                      const CalibrateOptions& options,
                      const WorkerLimits& limits);
std::string EncodeScoreJob(ScorerKind scorer,
                           const Rig& rig,
                           const Calibration& theta0,
                           const MotionSegment& segment,
                           const WorkerLimits& limits);
std::string EncodeProgress(const CalibrateProgress& progress);
// A failed result keeps only its message; any other keeps what the record of a
// calibration has, and Lambda.
std::string EncodeResult(const CalibrationResult& result);
std::string EncodeScore(const SegmentInformation& information);

// Return nullopt if the bytes are not from the functions above.
std::optional<Job> DecodeJob(std::string_view bytes);
std::optional<CalibrateProgress> DecodeProgress(std::string_view bytes);
std::optional<CalibrationResult> DecodeResult(std::string_view bytes);

// INTERNAL with the failure that was passed to EncodeResult(), or if the bytes
// are not from EncodeScore().
absl::StatusOr<SegmentInformation> DecodeScore(std::string_view bytes);

}  // namespace selfcal::server
