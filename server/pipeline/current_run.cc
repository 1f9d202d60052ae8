#include "server/pipeline/current_run.h"

#include "server/pipeline/backoff.h"

namespace selfcal::server {

void CurrentRun::Open() {
  const std::lock_guard lock(mutex_);
  open_ = true;
}

void CurrentRun::Close() {
  {
    const std::lock_guard lock(mutex_);
    open_ = false;
  }
  changed_.notify_all();
}

bool CurrentRun::open() const {
  const std::lock_guard lock(mutex_);
  return open_;
}

std::optional<absl::StatusOr<StoredRun>> CurrentRun::Begin(
    const BeginRun& begin) {
  const std::lock_guard lock(mutex_);
  if (!open_) return std::nullopt;
  absl::StatusOr<StoredRun> begun = begin();
  if (begun.ok()) state_ = State{begun->rig, begun->run, false, {}};
  return begun;
}

void CurrentRun::End() {
  {
    const std::lock_guard lock(mutex_);
    state_.reset();
  }
  changed_.notify_all();
}

bool CurrentRun::Cancel(const std::string& rig,
                        std::int64_t run,
                        const std::function<void()>& otherwise) {
  std::unique_lock lock(mutex_);
  if (!Is(rig, run)) {
    otherwise();
    return false;
  }
  state_->cancelled = true;
  changed_.notify_all();
  changed_.wait(lock, [&] { return !Is(rig, run); });
  return true;
}

void CurrentRun::Interrupt(const std::string& rig, std::int64_t run) {
  {
    const std::lock_guard lock(mutex_);
    if (!Is(rig, run)) return;
    state_->cancelled = true;
  }
  changed_.notify_all();
}

bool CurrentRun::cancelled() const {
  const std::lock_guard lock(mutex_);
  return state_ && state_->cancelled;
}

bool CurrentRun::interrupted() const {
  const std::lock_guard lock(mutex_);
  return Stops();
}

bool CurrentRun::Pause(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, time, [this] { return Stops(); });
}

void CurrentRun::AddStep(const CalibrateProgress& progress) {
  const std::lock_guard lock(mutex_);
  if (!state_) return;
  auto& steps = state_->steps;
  if (steps.empty() || steps.back().iteration < progress.iteration) {
    steps.push_back(progress);
  }
}

std::vector<CalibrateProgress> CurrentRun::StepsOf(const std::string& rig,
                                                   std::int64_t run) const {
  const std::lock_guard lock(mutex_);
  return Is(rig, run) ? state_->steps : std::vector<CalibrateProgress>();
}

absl::StatusOr<StoredCalibration> RetryUnlessInterrupted(
    CurrentRun* current,
    const std::function<absl::StatusOr<StoredCalibration>()>& call) {
  Backoff backoff;
  auto result = call();
  while (IsTransient(result.status()) && current->Pause(backoff.Next())) {
    result = call();
  }
  return result;
}

}  // namespace selfcal::server
