#include "server/pipeline/recalibration.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "server/pipeline/retry.h"

namespace selfcal::server {
namespace {

// Behind everything else, but not idle: it takes the lock of the store in
// between, and must be able to give it back.
constexpr int kNiceness = 10;

void LowerPriority() {
  const auto thread = static_cast<id_t>(syscall(SYS_gettid));
  if (setpriority(PRIO_PROCESS, thread, kNiceness) != 0) {
    spdlog::warn("recalibration runs at normal priority: {}",
                 std::strerror(errno));
  }
}

}  // namespace

std::string RunTopic(const std::string& rig, std::int64_t run) {
  return fmt::format("{}/{}", rig, run);
}

Recalibrator::Recalibrator(Store* store,
                           const PipelineOptions& options,
                           Estimators estimators,
                           Watchers<StoredCalibration>* calibration_watchers,
                           Watchers<RunUpdate>* run_watchers)
    : store_(store),
      options_(options),
      estimators_(std::move(estimators)),
      calibration_watchers_(calibration_watchers),
      run_watchers_(run_watchers) {}

Recalibrator::~Recalibrator() { Stop(); }

absl::Status Recalibrator::Start() {
  const std::lock_guard lock(mutex_);
  if (running_) {
    return absl::FailedPreconditionError(
        "recalibration has been started already");
  }
  running_ = true;
  thread_ = std::thread([this] {
    LowerPriority();
    Loop();
  });
  return absl::OkStatus();
}

void Recalibrator::Stop() {
  std::thread thread;
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
    thread.swap(thread_);
  }
  changed_.notify_all();
  if (thread.joinable()) {
    thread.join();
  }
}

void Recalibrator::Wake() {
  {
    const std::lock_guard lock(mutex_);
    ++wakes_;
  }
  changed_.notify_all();
}

absl::StatusOr<StoredRun> Recalibrator::Cancel(const std::string& rig,
                                               std::int64_t run) {
  {
    std::unique_lock lock(mutex_);
    if (!IsCurrent(rig, run)) {
      // Under the lock: the thread cannot begin it meanwhile.
      auto ended = store_->EndRun(
          rig, run, RunState::kCancelled, "cancelled on request");
      lock.unlock();
      if (ended.ok()) {
        run_watchers_->Publish(RunTopic(rig, run), {*ended, {}});
      }
      return ended;
    }
    current_->cancelled = true;
    changed_.notify_all();
    changed_.wait(lock, [&] { return !IsCurrent(rig, run); });
  }
  auto stored = store_->GetRun(rig, run);
  if (!stored.ok() || stored->state == RunState::kCancelled) {
    return stored;
  }
  if (stored->end_time_ns == 0) {
    return absl::UnavailableError(
        "the daemon is stopping; cancel again when it is back");
  }
  return absl::FailedPreconditionError(
      fmt::format("recalibration {} of rig {} has ended", run, rig));
}

CalibrateProgress Recalibrator::ProgressOf(const std::string& rig,
                                           std::int64_t run) {
  const std::lock_guard lock(mutex_);
  return IsCurrent(rig, run) ? current_->progress : CalibrateProgress();
}

bool Recalibrator::IsCurrent(const std::string& rig, std::int64_t run) const {
  return current_ && current_->rig == rig && current_->run == run;
}

bool Recalibrator::Interrupted() {
  const std::lock_guard lock(mutex_);
  return !running_ || (current_ && current_->cancelled);
}

bool Recalibrator::Cancelled() {
  const std::lock_guard lock(mutex_);
  return current_ && current_->cancelled;
}

bool Recalibrator::Pause(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(
      lock, time, [this] { return !running_ || current_->cancelled; });
  return running_ && !current_->cancelled;
}

void Recalibrator::Loop() {
  Backoff backoff;
  for (;;) {
    std::int64_t seen = 0;
    {
      const std::lock_guard lock(mutex_);
      if (!running_) {
        return;
      }
      seen = wakes_;
    }
    const auto runs = store_->ListUnfinishedRuns();
    bool all_done = runs.ok();
    if (!runs.ok()) {
      spdlog::error("cannot list runs: {}", runs.status().ToString());
    }
    for (std::size_t k = 0; runs.ok() && k < runs->size(); ++k) {
      all_done &= Execute((*runs)[k]);
    }
    std::unique_lock lock(mutex_);
    if (!all_done) {
      changed_.wait_for(lock, backoff.Next(), [this] { return !running_; });
      continue;
    }
    backoff.Reset();
    if (runs->empty()) {
      changed_.wait(lock, [&] { return !running_ || wakes_ != seen; });
    }
  }
}

}  // namespace selfcal::server
