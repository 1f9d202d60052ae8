// The thread that recalibrates: takes the unfinished runs of the store, oldest
// first, solves, validates, and has the result stored and told.
//
// A run is a row in the store from its trigger to its end. A crash leaves it
// running and it starts again, from its candidate if it had stored that; after
// kMaxAttempts crashes it fails instead. An orderly stop gives it back, which
// counts for nothing.
//
// One that nobody asked for by hand waits while the minimum interval of its rig
// or the conditions hold it back: it stays pending, with a message that says
// why.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/preflight/diagnose.h"
#include "server/domain/domain.h"
#include "server/pipeline/held_out.h"
#include "server/pipeline/pipeline.h"
#include "server/pipeline/watchers.h"
#include "server/store/store.h"

namespace selfcal::server {

class Recalibrator {
 public:
  static constexpr int kMaxAttempts = 3;
  // A client whose connection broke is back within a few seconds.
  static constexpr std::chrono::seconds kSessionGrace{5};

  // The watchers must outlive it.
  Recalibrator(Domain* domain,
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
  // No more segments of the rig's session are to come; once this has stood for
  // kSessionGrace without another, and all are scored, the store is asked for
  // the run of its end.
  void EndSession(const std::string& rig);
  // Another segment has come after all.
  void ContinueSession(const std::string& rig);
  // A segment of the rig is scored.
  void NoteScore(const std::string& rig);
  // As Pipeline::CancelRecalibration.
  absl::StatusOr<StoredRun> Cancel(const std::string& rig, std::int64_t run);
  // Each iteration of the run so far; nothing for one that is not at work.
  std::vector<CalibrateProgress> StepsOf(const std::string& rig,
                                         std::int64_t run);

 private:
  // The run that the thread works on.
  struct Current {
    std::string rig;
    std::int64_t run = 0;
    bool cancelled = false;
    std::vector<CalibrateProgress> steps;
  };
  // What a run came to: a candidate, or why there is none.
  struct Outcome {
    absl::Status status;
    std::optional<StoredCalibration> candidate;
    std::optional<SegmentKey> damaged;
  };
  enum class Execution { kDone, kHeldBack, kTryLater };

  using Clock = std::chrono::steady_clock;

  void Loop();
  // Creates the runs of sessions that have ended.
  absl::Status StartSessionRuns();
  // Those that are due, and have nothing under way that comes first.
  absl::StatusOr<std::vector<std::string>> EndedSessions();
  // Until when to sleep. With the lock held.
  Clock::time_point NextLook() const;
  // Of all unfinished runs; the worst of them.
  absl::StatusOr<Execution> ExecuteAll();
  Execution Execute(const StoredRun& run);
  Execution ExecuteBegun(const StoredRun& run);
  Execution Hold(const StoredRun& run, const std::string& reason);
  // Why the run does not begin yet; empty if it may.
  absl::StatusOr<std::string> HoldReason(const StoredRun& run);
  bool GiveUp(const StoredRun& run);
  Outcome Solve(const StoredRun& run);
  absl::StatusOr<StoredCalibration> EnsureCandidate(
      const StoredRun& run, std::optional<SegmentKey>* damaged);
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
  void Report(const StoredRun& run, const CalibrateProgress& progress);
  void TellEnd(const StoredRun& ended);
  // State, reasons, validation and verdict of the candidate against what is
  // active.
  absl::Status Validate(const StoredRun& run, StoredCalibration* candidate);
  absl::StatusOr<HeldOutSegments> GatherHeldOut(
      const StoredRun& run, const Rig& rig, const CalibrationResult& result);
  absl::StatusOr<std::optional<SegmentInformation>> Rescore(
      const std::string& rig_id,
      const SegmentKey& key,
      const Rig& rig,
      const Calibration& theta);
  absl::StatusOr<std::optional<Diagnosis>> DiagnoseUsed(
      const StoredRun& run, const Rig& rig, const CalibrationResult& result);
  // Validates and stores it, again where another version became active
  // meanwhile.
  absl::StatusOr<StoredCalibration> Finish(const StoredRun& run,
                                           StoredCalibration candidate);
  absl::Status Conclude(const StoredRun& run, const Outcome& outcome);
  absl::Status Succeed(const StoredRun& run,
                       const StoredCalibration& candidate);
  absl::Status End(const StoredRun& run,
                   RunState state,
                   const std::string& message);

  bool IsCurrent(const std::string& rig, std::int64_t run) const;
  bool Running();
  bool Interrupted();  // cancelled, or stopping
  bool Cancelled();
  bool Pause(std::chrono::milliseconds time);  // false when interrupted
  // Calls until it succeeds or fails for good; when interrupted, returns what
  // came last. A result that took minutes is not thrown away for a full disk.
  absl::StatusOr<StoredCalibration> Retry(
      const std::function<absl::StatusOr<StoredCalibration>()>& call);

  Domain* const domain_;
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
  std::map<std::string, Clock::time_point> ended_;  // rig -> when it is due
  std::thread thread_;
};

// What the topic of a run's watchers is called.
std::string RunTopic(const std::string& rig, std::int64_t run);

}  // namespace selfcal::server
