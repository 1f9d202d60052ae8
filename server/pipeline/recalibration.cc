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

Recalibrator::Recalibrator(Domain* domain,
                           const PipelineOptions& options,
                           Estimators estimators,
                           Watchers<StoredCalibration>* calibration_watchers,
                           Watchers<RunUpdate>* run_watchers)
    : context_{domain, options, std::move(estimators), run_watchers, &current_},
      calibration_watchers_(calibration_watchers) {}

Recalibrator::~Recalibrator() { Stop(); }

absl::Status Recalibrator::Start() {
  const std::lock_guard lock(mutex_);
  if (running_) {
    return absl::FailedPreconditionError(
        "recalibration has been started already");
  }
  running_ = true;
  current_.Open();
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
  current_.Close();
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
  SessionEnds::Clock::duration grace = kSessionGrace;
  const std::chrono::milliseconds idle = context_.options.session_idle;
  if (idle.count() > 0) {
    grace = std::min<SessionEnds::Clock::duration>(grace, idle);
  }
  sessions_.Add(rig, SessionEnds::Clock::now() + grace);
  Wake();
}

void Recalibrator::ContinueSession(const std::string& rig) {
  sessions_.Remove(rig);
}

void Recalibrator::NoteScore(const std::string& rig) {
  if (sessions_.Has(rig)) Wake();
}

absl::StatusOr<StoredRun> Recalibrator::Cancel(const std::string& rig,
                                               std::int64_t run) {
  absl::StatusOr<StoredRun> ended = absl::UnknownError("");
  const bool was_current = current_.Cancel(rig, run, [&] {
    ended = context_.domain->EndRun(
        rig, run, RunState::kCancelled, "cancelled on request");
  });
  if (!was_current) {
    if (ended.ok()) PublishRun(context_, *ended);
    return ended;
  }
  auto stored = context_.store()->GetRun(rig, run);
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
                                                     std::int64_t run) const {
  return current_.StepsOf(rig, run);
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
    // A session end that is due waits for scores or for a run, which wake the
    // thread.
    const auto now = SessionEnds::Clock::now();
    const auto next = sessions_.NextDue(now, now + context_.options.recheck);
    std::unique_lock lock(mutex_);
    if (!executed.ok() || *executed == Execution::kTryLater) {
      changed_.wait_for(lock, backoff.Next(), [this] { return !running_; });
      continue;
    }
    backoff.Reset();
    changed_.wait_until(
        lock, next, [&] { return !running_ || wakes_ != seen; });
  }
}

absl::Status Recalibrator::StartSessionRuns() {
  std::set<std::string> busy;
  SELFCAL_ASSIGN_OR_RETURN(
      const auto unscored,
      context_.store()->ListUnscored(std::numeric_limits<int>::max()));
  for (const auto& segment : unscored) busy.insert(segment.rig);
  SELFCAL_ASSIGN_OR_RETURN(const auto runs,
                           context_.store()->ListUnfinishedRuns());
  for (const StoredRun& run : runs) busy.insert(run.rig);
  const std::vector<std::string> ended =
      sessions_.Due(SessionEnds::Clock::now(), busy);

  const std::chrono::nanoseconds idle = context_.options.session_idle;
  const std::int64_t idle_since_ns =
      idle.count() > 0 ? context_.options.now_ns() - idle.count() : 0;
  SELFCAL_RETURN_IF_ERROR(
      context_.domain->StartSessionRuns(ended, idle_since_ns).status());
  for (const std::string& rig : ended) sessions_.Remove(rig);
  return absl::OkStatus();
}

absl::StatusOr<Execution> Recalibrator::ExecuteAll() {
  auto worst = Execution::kDone;
  for (bool any = true; any && worst != Execution::kTryLater;) {
    any = false;
    SELFCAL_RETURN_IF_ERROR(
        context_.domain->StartTimedRuns(context_.options.now_ns()).status());
    SELFCAL_RETURN_IF_ERROR(StartSessionRuns());
    SELFCAL_ASSIGN_OR_RETURN(const std::vector<StoredRun> runs,
                             context_.store()->ListUnfinishedRuns());
    for (const StoredRun& run : runs) {
      const Execution executed =
          ExecuteRun(context_, calibration_watchers_, run);
      worst = std::max(worst, executed);
      any |= executed == Execution::kDone && current_.open();
    }
  }
  return worst;
}

}  // namespace selfcal::server
