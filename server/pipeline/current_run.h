// The run that is being executed: its iterations so far, and whether it is to
// go on. Any thread may call; one thread executes.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "server/store/store.h"

namespace selfcal::server {

class CurrentRun {
 public:
  // Runs may begin after Open, until Close, which interrupts the current one.
  void Open();
  void Close();
  bool open() const;

  // Calls `begin`, and makes the run that it returns the current one. While it
  // is called, nobody can cancel or close. nullopt if it is closed.
  using BeginRun = std::function<absl::StatusOr<StoredRun>()>;
  std::optional<absl::StatusOr<StoredRun>> Begin(const BeginRun& begin);
  // The current run has ended.
  void End();

  // If the run is the current one, interrupts it, waits for its end and returns
  // true. Else calls `otherwise`; meanwhile it cannot begin.
  bool Cancel(const std::string& rig,
              std::int64_t run,
              const std::function<void()>& otherwise);
  // Interrupts the run if it is the current one, without waiting.
  void Interrupt(const std::string& rig, std::int64_t run);
  bool cancelled() const;
  bool interrupted() const;  // cancelled, or closed
  // Waits; false if interrupted.
  bool Pause(std::chrono::milliseconds time);

  // Keeps the first report of each iteration.
  void AddStep(const CalibrateProgress& progress);
  // The iterations of the run so far; empty unless it is the current one.
  std::vector<CalibrateProgress> StepsOf(const std::string& rig,
                                         std::int64_t run) const;

 private:
  struct State {
    std::string rig;
    std::int64_t run = 0;
    bool cancelled = false;
    std::vector<CalibrateProgress> steps;
  };

  bool Is(const std::string& rig, std::int64_t run) const {
    return state_ && state_->rig == rig && state_->run == run;
  }
  bool Stops() const { return !open_ || (state_ && state_->cancelled); }

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = false;
  std::optional<State> state_;
};

// Repeats the call until it succeeds or fails for good; when interrupted,
// returns the last result. A result that took minutes is not discarded because
// the disk is full.
absl::StatusOr<StoredCalibration> RetryUnlessInterrupted(
    CurrentRun* current,
    const std::function<absl::StatusOr<StoredCalibration>()>& call);

}  // namespace selfcal::server
