#include "client/demo/stream_segments.h"

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "client/selfcal/client.h"
#include "client/text/text.h"

namespace selfcal::client {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

class Streaming {
 public:
  Streaming(const std::string& target,
            const std::string& rig,
            const std::vector<MotionSegment>& segments,
            Report* report)
      : segments_(segments),
        report_(report),
        view_(target, rig),
        stream_({.target = target, .rig = rig},
                [this](const Acknowledgement& ack) { OnAck(ack); }) {}

  absl::Status Run(double timeout_s) {
    absl::StatusOr<std::vector<v1::Recalibration>> runs = view_.GetRuns();
    if (!runs.ok()) return runs.status();
    for (const v1::Recalibration& run : *runs) {
      if (HasEnded(run)) seen_runs_.insert(run.name());
    }
    const auto deadline =
        Clock::now() + std::chrono::duration<double>(timeout_s);
    while (Clock::now() < deadline) {
      SendMore();
      absl::StatusOr<bool> done = Look();
      if (!done.ok()) return done.status();
      if (*done) return stream_.Drain(10s);
      std::this_thread::sleep_for(100ms);
    }
    return absl::DeadlineExceededError(fmt::format(
        "not everything was scored and calibrated in {} s", timeout_s));
  }

  std::vector<v1::Recalibration>& runs() { return runs_; }

 private:
  static bool HasEnded(const v1::Recalibration& run) {
    return run.state() != v1::Recalibration::PENDING &&
           run.state() != v1::Recalibration::RUNNING;
  }

  void OnAck(const Acknowledgement& ack) {
    if (ack.verdict != Acknowledgement::Verdict::kRejected) {
      ++acknowledged_;
      return;
    }
    std::lock_guard lock(mutex_);
    for (const Violation& v : ack.violations) {
      rejections_.push_back(
          fmt::format("segment {}: {}: {}", ack.key.index, v.field, v.message));
    }
  }

  void SendMore() {
    while (next_ < segments_.size() &&
           stream_.statistics().queued - acknowledged_ < 8 &&
           stream_.Send(segments_[next_])) {
      ++next_;
    }
  }

  // Polls the daemon; true when there is nothing left to wait for.
  absl::StatusOr<bool> Look() {
    {
      std::lock_guard lock(mutex_);
      if (!rejections_.empty()) {
        return absl::InvalidArgumentError(rejections_.front());
      }
    }
    const std::uint64_t acknowledged = acknowledged_;
    absl::StatusOr<bool> unscored = view_.HasUnscored();
    if (!unscored.ok()) return unscored.status();
    absl::StatusOr<std::vector<v1::Table>> tables = view_.GetTables();
    if (!tables.ok()) return tables.status();
    const std::int64_t scored = tables->empty() ? 0 : tables->front().scored();
    report_->Progress(
        fmt::format("sent {}/{}  durable {}  scored {}  tables: {}",
                    next_,
                    segments_.size(),
                    acknowledged,
                    scored,
                    Fill(*tables)),
        scored != last_scored_);
    last_scored_ = scored;
    // The last score and the run that it triggers are one transaction.
    absl::StatusOr<bool> idle = WatchRuns();
    if (!idle.ok()) return idle.status();
    return *idle && !*unscored && acknowledged == segments_.size();
  }

  // Follows every new run to its end; true if there was none.
  absl::StatusOr<bool> WatchRuns() {
    absl::StatusOr<std::vector<v1::Recalibration>> runs = view_.GetRuns();
    if (!runs.ok()) return runs.status();
    bool idle = true;
    for (auto run = runs->rbegin(); run != runs->rend(); ++run) {
      if (!seen_runs_.insert(run->name()).second) continue;
      idle = false;  // look again: its end may start the next
      report_->Line(fmt::format(
          "{} begins: {}", run->name(), TriggerText(run->trigger())));
      absl::StatusOr<v1::Recalibration> ended =
          FollowRun(view_, run->name(), report_);
      if (!ended.ok()) return ended.status();
      runs_.push_back(*std::move(ended));
    }
    return idle;
  }

  const std::vector<MotionSegment>& segments_;
  Report* const report_;
  DaemonView view_;
  std::size_t next_ = 0;
  std::int64_t last_scored_ = -1;
  std::atomic<std::uint64_t> acknowledged_ = 0;
  std::mutex mutex_;
  std::vector<std::string> rejections_;  // guarded by mutex_
  std::set<std::string> seen_runs_;
  std::vector<v1::Recalibration> runs_;
  SegmentStream stream_;  // last: its callback uses the others
};

}  // namespace

absl::StatusOr<std::vector<v1::Recalibration>> StreamSegments(
    const std::string& target,
    const std::string& rig,
    const std::vector<MotionSegment>& segments,
    double timeout_s,
    Report* report) {
  Streaming streaming(target, rig, segments, report);
  if (absl::Status status = streaming.Run(timeout_s); !status.ok()) {
    return status;
  }
  return std::move(streaming.runs());
}

absl::StatusOr<v1::Recalibration> FollowRun(DaemonView& view,
                                            const std::string& name,
                                            Report* report) {
  v1::Recalibration last;
  int shown = -1;
  absl::Status status = view.WatchRun(name, [&](const auto& update) {
    report->Progress(fmt::format("solving: iteration {}, cost {:.6g}, last "
                                 "step {:.3g} sigma",
                                 update.iteration(),
                                 update.cost(),
                                 update.step_sigmas()),
                     update.iteration() >= shown + 5);
    if (update.iteration() >= shown + 5) shown = update.iteration();
    last = update;
  });
  if (!status.ok()) return status;
  report->Run(last);
  return last;
}

}  // namespace selfcal::client
