// Computes scores and calibrations of a rig by both cores, on the data that is
// kept, and compares them. A difference beyond rounding or convergence is
// recorded in an event, and with the version that was checked: for scores, on
// which tables, validation and change detection rest, with the active one.
//
// Any thread may call; it computes on the thread of the caller.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"
#include "server/pipeline/verification.h"
#include "server/store/store.h"

namespace selfcal::server {

class Verifier {
 public:
  // `domain` must outlive it. `on_finding` is called with the rig of each
  // finding that was recorded.
  Verifier(Domain* domain,
           const PipelineOptions& options,
           const Estimators& estimators,
           std::function<void(const std::string&)> on_finding)
      : domain_(domain),
        store_(domain->store()),
        options_(options),
        estimators_(estimators),
        on_finding_(std::move(on_finding)) {}

  // Makes every call return soon, with CANCELLED, from now on.
  void Stop() { stopped_ = true; }

  // As Pipeline::VerifyRig.
  absl::StatusOr<Verification> VerifyRig(
      const std::string& rig,
      const OnVerificationStep& on_step,
      const std::function<bool()>& interrupted);

  // Compares `information` of a segment with its score by the other core.
  absl::StatusOr<ScoreCheck> CheckScore(
      const Rig& rig,
      const MotionSegment& segment,
      const SegmentInformation& information,
      const std::function<bool()>& interrupted);

  // Computes a version by both cores, on those of its segments whose data is
  // kept. They start from the version, so that both soon converge if it is
  // right.
  absl::StatusOr<CalibrationCheck> CheckCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::function<bool()>& interrupted);

  // Reports each check to the observer, and records the finding, if there is
  // one.
  absl::Status Conclude(const std::string& rig,
                        const Verification& verification);

 private:
  using Interrupted = std::function<bool()>;

  Interrupted OrStopped(const Interrupted& interrupted) const;
  absl::StatusOr<ScoreCheck> CheckStored(const StoredRig& rig,
                                         const StoredSegment& segment,
                                         const Interrupted& interrupted);
  // Those of its segments whose data can be read.
  absl::StatusOr<std::vector<SegmentKey>> KeysWithData(
      const StoredCalibration& version);
  absl::StatusOr<CalibrationResult> Solve(SolverKind solver,
                                          const Rig& rig,
                                          const Calibration& start,
                                          const std::vector<SegmentKey>& keys,
                                          CalibrateOptions options,
                                          const Interrupted& interrupted);

  Domain* const domain_;
  Store* const store_;
  const PipelineOptions options_;
  const Estimators estimators_;
  const std::function<void(const std::string&)> on_finding_;
  std::atomic<bool> stopped_ = false;
  std::mutex mutex_;  // held by VerifyRig
};

}  // namespace selfcal::server
