#include "server/pipeline/recalibration.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <utility>

#include "server/pipeline/backoff.h"
#include "server/pipeline/rescoring.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// How often devices are looked for that have become silent: they are so for a
// day.
constexpr std::chrono::minutes kSilentInterval{1};

// Rigs whose outdated scores are computed again at once.
constexpr int kRescoredRigs = 100;

}  // namespace

Recalibrator::Executor::Executor(const RunContext& shared) : context(shared) {
  context.current = &current;
}

Recalibrator::Recalibrator(Domain* domain,
                           RigClaims* claims,
                           const PipelineOptions& options,
                           Estimators estimators,
                           Watchers<StoredCalibration>* calibration_watchers,
                           Watchers<RunUpdate>* run_watchers)
    : shared_{domain,
              claims,
              options,
              std::move(estimators),
              run_watchers,
              nullptr,
              ""},
      calibration_watchers_(calibration_watchers),
      completion_(domain) {
  for (int k = 0; k < std::max(1, options.solver_processes); ++k) {
    executors_.push_back(std::make_unique<Executor>(shared_));
  }
}

Recalibrator::~Recalibrator() { Stop(); }

absl::Status Recalibrator::Start() {
  {
    const std::lock_guard lock(mutex_);
    if (running_) {
      return absl::FailedPreconditionError(
          "recalibration has been started already");
    }
    running_ = true;
  }
  for (const auto& executor : executors_) {
    executor->current.Open();
    executor->thread = std::thread([this, e = executor.get()] { Loop(e); });
  }
  return absl::OkStatus();
}

void Recalibrator::Stop() {
  std::vector<std::thread> threads;
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
    for (const auto& executor : executors_) {
      threads.push_back(std::move(executor->thread));
    }
  }
  for (const auto& executor : executors_) executor->current.Close();
  changed_.notify_all();
  for (std::thread& thread : threads) {
    if (thread.joinable()) thread.join();
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
  const std::chrono::milliseconds idle = shared_.options.session_idle;
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
  const auto end = [&] {
    ended = shared_.domain->EndRun(
        rig, run, RunState::kCancelled, "cancelled on request");
  };
  bool was_current = false;
  for (bool again = true; again;) {
    again = false;
    Executor* executor = nullptr;
    {
      const std::lock_guard lock(executing_mutex_);
      const auto found = executing_.find(rig);
      if (found != executing_.end()) executor = found->second;
      if (executor == nullptr) end();  // under the lock nobody can begin it
    }
    if (executor == nullptr) break;
    was_current = executor->current.Cancel(rig, run, [&] {
      // It cannot begin it; another one can, once it executes for the rig.
      const std::lock_guard lock(executing_mutex_);
      const auto found = executing_.find(rig);
      again = found == executing_.end() || found->second != executor;
      if (!again) end();
    });
  }
  if (!was_current) {
    if (ended.ok()) PublishRun(shared_, *ended);
    return ended;
  }
  auto stored = shared_.store()->GetRun(rig, run);
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

void Recalibrator::Interrupt(const std::string& rig, std::int64_t run) {
  for (const auto& executor : executors_) {
    executor->current.Interrupt(rig, run);
  }
}

std::vector<CalibrateProgress> Recalibrator::StepsOf(const std::string& rig,
                                                     std::int64_t run) const {
  for (const auto& executor : executors_) {
    auto steps = executor->current.StepsOf(rig, run);
    if (!steps.empty()) return steps;
  }
  return {};
}

void Recalibrator::Loop(Executor* executor) {
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
    const auto executed = ExecuteAll(executor);
    if (!executed.ok()) {
      spdlog::error("cannot list runs: {}", executed.status().ToString());
    }
    // A session end that is due waits for scores or for a run, which wake the
    // thread.
    const auto now = SessionEnds::Clock::now();
    const auto next = sessions_.NextDue(now, now + shared_.options.recheck);
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

absl::Status Recalibrator::StartDueRuns() {
  const std::lock_guard lock(starting_);
  // Each of several daemons knows which sessions have ended at itself; one of
  // them looks at the times of all rigs.
  const bool is_first = shared_.claims->IsFirst();
  const std::int64_t now_ns = shared_.options.now_ns();
  if (is_first) {
    SELFCAL_RETURN_IF_ERROR(shared_.domain->StartTimedRuns(now_ns).status());
    const auto now = SessionEnds::Clock::now();
    if (now >= look_for_silent_) {
      SELFCAL_RETURN_IF_ERROR(shared_.domain->NoteSilentDevices());
      look_for_silent_ = now + kSilentInterval;
    }
    completion_.Continue();
  }
  std::vector<std::string> ended = sessions_.Due(SessionEnds::Clock::now());
  SELFCAL_ASSIGN_OR_RETURN(
      const std::set<std::string> busy,
      shared_.store()->FindBusyRigs({ended.begin(), ended.end()}));
  std::erase_if(ended, [&](const auto& rig) { return busy.contains(rig); });

  const std::chrono::nanoseconds idle = shared_.options.session_idle;
  const std::int64_t idle_since_ns =
      idle.count() > 0 && is_first ? now_ns - idle.count() : 0;
  SELFCAL_RETURN_IF_ERROR(
      shared_.domain->StartSessionRuns(ended, idle_since_ns).status());
  for (const std::string& rig : ended) sessions_.Remove(rig);
  if (is_first) {
    SELFCAL_ASSIGN_OR_RETURN(
        const bool more, shared_.domain->AreChecksDue(now_ns, idle_since_ns));
    if (more) Wake();
  }
  return absl::OkStatus();
}

absl::Status Recalibrator::ResumeRescoring(const Executor& executor) {
  // One daemon does so for all: it is rare.
  if (!shared_.claims->IsFirst()) return absl::OkStatus();
  const std::lock_guard lock(starting_);
  SELFCAL_ASSIGN_OR_RETURN(
      const std::vector<std::string> rigs,
      shared_.store()->ListRigsToCheck(
          RigCheck::kScores, shared_.options.now_ns(), kRescoredRigs));
  for (const std::string& rig : rigs) {
    if (!executor.current.open()) break;
    RescoreAtActive(shared_.domain, shared_.estimators, rig);
  }
  return absl::OkStatus();
}

Execution Recalibrator::ExecuteOwn(Executor* executor,
                                   const StoredRun& listed) {
  const std::optional<RigClaim> claim = shared_.claims->Find(listed.rig);
  if (!claim) return Execution::kDeferred;
  {
    const std::lock_guard lock(executing_mutex_);
    if (!executing_.emplace(listed.rig, executor).second) {
      return Execution::kDeferred;
    }
  }
  executor->context.claim = *claim;
  // Another thread may have ended it since it was listed.
  const auto run = shared_.store()->GetRun(listed.rig, listed.run);
  auto executed = Execution::kTryLater;
  if (run.ok()) {
    executed = run->end_time_ns != 0
                   ? Execution::kDone
                   : ExecuteRun(executor->context, calibration_watchers_, *run);
  } else if (absl::IsNotFound(run.status())) {
    executed = Execution::kDone;
  } else {
    spdlog::error("cannot read run {} of rig {}: {}",
                  listed.run,
                  listed.rig,
                  run.status().ToString());
  }
  const std::lock_guard lock(executing_mutex_);
  executing_.erase(listed.rig);
  return executed;
}

absl::StatusOr<Execution> Recalibrator::ExecuteAll(Executor* executor) {
  auto worst = Execution::kDone;
  for (bool any = true; any && worst != Execution::kTryLater;) {
    any = false;
    SELFCAL_RETURN_IF_ERROR(StartDueRuns());
    SELFCAL_RETURN_IF_ERROR(ResumeRescoring(*executor));
    const auto again =
        std::chrono::steady_clock::now() + shared_.options.recheck;
    SELFCAL_ASSIGN_OR_RETURN(
        const std::vector<StoredRun> runs,
        shared_.store()->ListUnfinishedRuns(shared_.claims->replica()));
    for (const StoredRun& run : runs) {
      const Execution executed = ExecuteOwn(executor, run);
      worst = std::max(worst, executed);
      any |= executed == Execution::kDone && executor->current.open();
      // However many runs there are, others may be due.
      if (any && worst != Execution::kTryLater &&
          std::chrono::steady_clock::now() >= again) {
        break;
      }
    }
  }
  return worst;
}

}  // namespace selfcal::server
