// The thread that recalibrates: takes the unfinished runs of the store, oldest
// first, solves, validates, and has the result stored and told.
//
// A run is a row in the store from its trigger to its end. A crash leaves it
// running and it starts again; after kMaxAttempts crashes it fails instead. An
// orderly stop gives it back, which counts for nothing.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/pipeline/pipeline.h"
#include "server/pipeline/watchers.h"
#include "server/store/store.h"

namespace selfcal::server {

class Recalibrator {
 public:
  static constexpr int kMaxAttempts = 3;

  // The watchers must outlive it.
  Recalibrator(Store* store,
               const PipelineOptions& options,
               Estimators estimators,
               Watchers<StoredCalibration>* calibration_watchers,
               Watchers<RunUpdate>* run_watchers);
  ~Recalibrator();

  absl::Status Start();
  // Returns when the thread has ended.
  void Stop();
  // There may be a new run in the store.
  void Wake();
  // As Pipeline::CancelRecalibration.
  absl::StatusOr<StoredRun> Cancel(const std::string& rig, std::int64_t run);
  // How far the run is; zeros for one that is not at work.
  CalibrateProgress ProgressOf(const std::string& rig, std::int64_t run);

 private:
  // The run that the thread works on.
  struct Current {
    std::string rig;
    std::int64_t run = 0;
    bool cancelled = false;
    CalibrateProgress progress;
  };
  // What a run came to: a result, or why there is none.
  struct Outcome {
    absl::Status status;
    std::optional<StoredCalibration> calibration;
    std::optional<SegmentKey> damaged;
  };

  void Loop();
  // Whether it ended or was given back; false: try again later.
  bool Execute(const StoredRun& run);
  bool GiveUp(const StoredRun& run);
  Outcome Solve(const StoredRun& run);
  absl::StatusOr<StoredCalibration> FindCandidate(
      const StoredRun& run, std::optional<SegmentKey>* damaged);
  absl::Status LoadSegments(const StoredRun& run,
                            std::vector<MotionSegment>* segments,
                            std::optional<SegmentKey>* damaged);
  absl::StatusOr<CalibrationResult> RunSolver(
      const StoredRun& run,
      const Rig& rig,
      const Calibration& start,
      const std::vector<MotionSegment>& segments,
      const CalibrateOptions& options);
  bool Report(const StoredRun& run, const CalibrateProgress& progress);
  absl::Status Conclude(const StoredRun& run, const Outcome& outcome);
  absl::Status Succeed(const StoredRun& run,
                       const StoredCalibration& calibration);
  absl::Status End(const StoredRun& run,
                   RunState state,
                   const std::string& message);

  bool IsCurrent(const std::string& rig, std::int64_t run) const;
  bool Interrupted();  // cancelled, or stopping
  bool Cancelled();
  bool Pause(std::chrono::milliseconds time);  // false when interrupted

  Store* const store_;
  const PipelineOptions options_;
  const Estimators estimators_;
  Watchers<StoredCalibration>* const calibration_watchers_;
  Watchers<RunUpdate>* const run_watchers_;

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool running_ = false;
  std::int64_t wakes_ = 0;
  std::optional<Current> current_;
  std::thread thread_;
};

// What the topic of a run's watchers is called.
std::string RunTopic(const std::string& rig, std::int64_t run);

}  // namespace selfcal::server
