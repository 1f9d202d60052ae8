#include "server/pipeline/recalibration.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "server/pipeline/backoff.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
std::string RunTopic(const std::string& rig, std::int64_t run) {
  return fmt::format("{}/{}", rig, run);
}

Recalibrator::Recalibrator(Domain* domain,
                           const PipelineOptions& options,
                           Estimators estimators,
                           Watchers<StoredCalibration>* calibration_watchers,
                           Watchers<RunUpdate>* run_watchers)
    : domain_(domain),
      store_(domain->store()),
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
  thread_ = std::thread([this] { Loop(); });
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

void Recalibrator::EndSession(const std::string& rig) {
  Clock::duration grace = kSessionGrace;
  if (options_.session_idle.count() > 0) {
    grace = std::min<Clock::duration>(grace, options_.session_idle);
  }
  {
    const std::lock_guard lock(mutex_);
    ended_[rig] = Clock::now() + grace;
    ++wakes_;
  }
  changed_.notify_all();
}

void Recalibrator::ContinueSession(const std::string& rig) {
  const std::lock_guard lock(mutex_);
  ended_.erase(rig);
}

void Recalibrator::NoteScore(const std::string& rig) {
  {
    const std::lock_guard lock(mutex_);
    if (!ended_.contains(rig)) return;
    ++wakes_;
  }
  changed_.notify_all();
}

absl::StatusOr<StoredRun> Recalibrator::Cancel(const std::string& rig,
                                               std::int64_t run) {
  {
    std::unique_lock lock(mutex_);
    if (!IsCurrent(rig, run)) {
      // Under the lock, so that the thread cannot begin it meanwhile.
      auto ended = domain_->EndRun(
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

std::vector<CalibrateProgress> Recalibrator::StepsOf(const std::string& rig,
                                                     std::int64_t run) {
  const std::lock_guard lock(mutex_);
  return IsCurrent(rig, run) ? current_->steps
                             : std::vector<CalibrateProgress>();
}

bool Recalibrator::IsCurrent(const std::string& rig, std::int64_t run) const {
  return current_ && current_->rig == rig && current_->run == run;
}

bool Recalibrator::Running() {
  const std::lock_guard lock(mutex_);
  return running_;
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

absl::StatusOr<StoredCalibration> Recalibrator::Retry(
    const std::function<absl::StatusOr<StoredCalibration>()>& call) {
  Backoff backoff;
  auto result = call();
  while (IsTransient(result.status()) && Pause(backoff.Next())) {
    result = call();
  }
  return result;
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
    const auto executed = ExecuteAll();
    if (!executed.ok()) {
      spdlog::error("cannot list runs: {}", executed.status().ToString());
    }
    const auto woken = [&] { return !running_ || wakes_ != seen; };
    std::unique_lock lock(mutex_);
    if (!executed.ok() || *executed == Execution::kTryLater) {
      changed_.wait_for(lock, backoff.Next(), [this] { return !running_; });
      continue;
    }
    backoff.Reset();
    changed_.wait_until(lock, NextLook(), woken);
  }
}

Recalibrator::Clock::time_point Recalibrator::NextLook() const {
  const auto now = Clock::now();
  Clock::time_point next = now + options_.recheck;
  // A session end that is due waits for scores or for a run, which wake the
  // thread.
  for (const auto& [rig, due] : ended_) {
    if (due > now) next = std::min(next, due);
  }
  return next;
}

absl::StatusOr<std::vector<std::string>> Recalibrator::EndedSessions() {
  std::set<std::string> busy;
  SELFCAL_ASSIGN_OR_RETURN(
      const auto unscored,
      store_->ListUnscored(std::numeric_limits<int>::max()));
  for (const auto& segment : unscored) busy.insert(segment.rig);
  SELFCAL_ASSIGN_OR_RETURN(const auto runs, store_->ListUnfinishedRuns());
  for (const StoredRun& run : runs) busy.insert(run.rig);
  std::vector<std::string> ended;
  const auto now = Clock::now();
  const std::lock_guard lock(mutex_);
  for (const auto& [rig, due] : ended_) {
    if (due <= now && !busy.contains(rig)) ended.push_back(rig);
  }
  return ended;
}

absl::Status Recalibrator::StartSessionRuns() {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::string> ended,
                           EndedSessions());
  const std::chrono::nanoseconds idle = options_.session_idle;
  SELFCAL_RETURN_IF_ERROR(
      domain_
          ->StartSessionRuns(
              ended, idle.count() > 0 ? options_.now_ns() - idle.count() : 0)
          .status());
  const std::lock_guard lock(mutex_);
  for (const std::string& rig : ended) ended_.erase(rig);
  return absl::OkStatus();
}

absl::StatusOr<Recalibrator::Execution> Recalibrator::ExecuteAll() {
  auto worst = Execution::kDone;
  for (bool any = true; any && worst != Execution::kTryLater;) {
    any = false;
    SELFCAL_RETURN_IF_ERROR(domain_->StartAgedRuns(options_.now_ns()).status());
    SELFCAL_RETURN_IF_ERROR(StartSessionRuns());
    SELFCAL_ASSIGN_OR_RETURN(const std::vector<StoredRun> runs,
                             store_->ListUnfinishedRuns());
    for (const StoredRun& run : runs) {
      const Execution executed = Execute(run);
      worst = std::max(worst, executed);
      any |= executed == Execution::kDone && Running();
    }
  }
  return worst;
}

absl::StatusOr<std::string> Recalibrator::HoldReason(const StoredRun& run) {
  if (run.trigger == RunTrigger::kManual) {
    return "";
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store_->GetRig(run.rig));
  const std::int64_t interval_ns = rig.policy.recalibration_min_interval_ns;
  if (interval_ns > 0) {
    // The newest is this run.
    SELFCAL_ASSIGN_OR_RETURN(const auto newest,
                             store_->ListRuns(run.rig, {2, ""}));
    const bool too_early =
        newest.items.size() > 1 &&
        options_.now_ns() - newest.items[1].end_time_ns < interval_ns;
    if (too_early) {
      return fmt::format(
          "the minimum interval of {:g} s since recalibration {} is not over",
          static_cast<double>(interval_ns) * 1e-9,
          newest.items[1].run);
    }
  }
  return options_.conditions == nullptr ? ""
                                        : options_.conditions->HoldReason();
}

}  // namespace selfcal::server
