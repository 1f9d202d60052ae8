// The thread that recalibrates: takes the unfinished runs of the store, oldest
// first, solves and validates, and has the result stored and published.
//
// A run is a record in the store from its trigger to its end. After a crash it
// is still running and starts again, from its candidate if that was stored;
// after kMaxAttempts crashes it fails instead. An orderly stop releases it
// without counting the attempt.
//
// A run that was not started manually is deferred by the minimum interval of
// its rig or by the conditions: it stays pending, with a message that says why.
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
  // A client whose connection broke reconnects within a few seconds.
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
  // Looks for new runs in the store.
  void Wake();
  // Notes that the rig's session has no more segments. If none arrives for
  // kSessionGrace, and all are scored, the run at the end of the session is
  // created if it is due.
  void EndSession(const std::string& rig);
  // Notes that another segment of the session has arrived after all.
  void ContinueSession(const std::string& rig);
  // Notes that a segment of the rig was scored.
  void NoteScore(const std::string& rig);
  // As Pipeline::CancelRecalibration.
  absl::StatusOr<StoredRun> Cancel(const std::string& rig, std::int64_t run);
  // Each iteration of the run so far; empty unless it is being executed.
  std::vector<CalibrateProgress> StepsOf(const std::string& rig,
                                         std::int64_t run);

 private:
  // The run that the thread executes.
  struct Current {
    std::string rig;
    std::int64_t run = 0;
    bool cancelled = false;
    std::vector<CalibrateProgress> steps;
  };
  // The outcome of a run: a candidate, or why there is none.
  struct Outcome {
    absl::Status status;
    std::optional<StoredCalibration> candidate;
    std::optional<SegmentKey> damaged;
  };
  enum class Execution { kDone, kDeferred, kTryLater };

  using Clock = std::chrono::steady_clock;

  void Loop();
  // Creates the runs of sessions that have ended.
  absl::Status StartSessionRuns();
  // Rigs whose session end is due, without unscored segments or an unfinished
  // run.
  absl::StatusOr<std::vector<std::string>> EndedSessions();
  // When to look again. Call with the lock held.
  Clock::time_point NextLook() const;
  // Executes all unfinished runs; returns the worst result.
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
  // Sets state, reasons, validation and verdict of the candidate, validated
  // against the active version.
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
  // Validates and stores the candidate, again if another version becomes active
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
  // Repeats the call until it succeeds or fails for good; when interrupted,
  // returns the last result. A result that took minutes is not discarded
  // because the disk is full.
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

// The topic of the watchers of a run.
std::string RunTopic(const std::string& rig, std::int64_t run);

}  // namespace selfcal::server
