// Between the input and result of a calibration or a score and the bytes
// (job.proto) that go to a worker and come back. Doubles come back as they
// were, to the bit.
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
  // Score the one segment at theta_start; nothing: calibrate.
  std::optional<ScorerKind> scorer = std::nullopt;
};

// Empty where it is more than a message can hold (2 GiB).
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
std::string EncodeResult(const CalibrationResult& result);
std::string EncodeScore(const SegmentInformation& information);

// Nothing where the bytes are not what the functions above made.
std::optional<Job> DecodeJob(std::string_view bytes);
std::optional<CalibrateProgress> DecodeProgress(std::string_view bytes);
std::optional<CalibrationResult> DecodeResult(std::string_view bytes);

// INTERNAL with the failure that EncodeResult() was given, or where the bytes
// are not what EncodeScore() made.
absl::StatusOr<SegmentInformation> DecodeScore(std::string_view bytes);

}  // namespace selfcal::server
