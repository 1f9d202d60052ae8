// The threads that recalibrate: each takes the oldest unfinished run of the
// store whose rig no other one works for, and executes it (run_execution.h).
//
// A run is a record in the store from its trigger to its end. After a crash it
// is still running and starts again, from its candidate if that was stored;
// after kMaxRunAttempts crashes it fails instead. An orderly stop releases it
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
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/pipeline/run_context.h"
#include "server/pipeline/run_execution.h"
#include "server/pipeline/session_ends.h"
#include "server/pipeline/version_completion.h"

namespace selfcal::server {

class Recalibrator {
 public:
  // A client whose connection broke reconnects within a few seconds.
  static constexpr std::chrono::seconds kSessionGrace{5};

  // Executes the runs of the rigs of `claims`, which must outlive it, as the
  // watchers must.
  Recalibrator(Domain* domain,
               RigClaims* claims,
               const PipelineOptions& options,
               Estimators estimators,
               Watchers<StoredCalibration>* calibration_watchers,
               Watchers<RunUpdate>* run_watchers);
  ~Recalibrator();

  absl::Status Start();
  // Returns when the threads have ended.
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
  // Interrupts the run, which another daemon has ended, if it is executed here.
  void Interrupt(const std::string& rig, std::int64_t run);
  // Each iteration of the run so far; empty unless it is being executed.
  std::vector<CalibrateProgress> StepsOf(const std::string& rig,
                                         std::int64_t run) const;

 private:
  // One thread, and the run that it executes.
  struct Executor {
    explicit Executor(const RunContext& shared);

    CurrentRun current;
    RunContext context;
    std::thread thread;
  };

  void Loop(Executor* executor);
  // Executes unfinished runs until there are none that may begin and whose rig
  // no other thread executes a run of; returns the worst result.
  absl::StatusOr<Execution> ExecuteAll(Executor* executor);
  // Creates the runs of times and of sessions that have ended.
  absl::Status StartDueRuns();
  // Computes outdated scores again, of rigs for which nobody has ended that in
  // time: it has failed, or its daemon has ended. A rig whose run scores at its
  // candidate waits for the end of the run.
  absl::Status ResumeRescoring(const Executor& executor);
  // Executes the run if the work of its rig is this daemon's, and no other
  // thread does it.
  Execution ExecuteOwn(Executor* executor, const StoredRun& listed);

  const RunContext shared_;  // without a current run
  Watchers<StoredCalibration>* const calibration_watchers_;
  SessionEnds sessions_;
  // One thread at a time creates runs, or computes outdated scores; guards the
  // next two.
  std::mutex starting_;
  VersionCompletion completion_;
  SessionEnds::Clock::time_point look_for_silent_{};  // at this time again
  std::vector<std::unique_ptr<Executor>> executors_;

  // The executor of each rig's run, from before it begins until after its end.
  std::map<std::string, Executor*> executing_;
  std::mutex executing_mutex_;  // of it; Cancel holds it while it writes

  // Guards what follows. Nobody writes while holding it: a stream of segments
  // may end on the store's thread, which then wakes the executors.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool running_ = false;
  std::int64_t wakes_ = 0;
};

}  // namespace selfcal::server
