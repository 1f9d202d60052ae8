#include "client/demo/demo.h"

#include <fmt/format.h>
#include <google/protobuf/util/message_differencer.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "client/demo/daemon_process.h"
#include "client/demo/daemon_view.h"
#include "client/selfcal/client.h"
#include "client/text/text.h"

namespace selfcal::client {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// Streams the segments and shows how the daemon processes them.
class Streaming {
 public:
  Streaming(const DaemonProcess& daemon, const Device& device, Report* report)
      : device_(device),
        report_(report),
        view_(daemon.target(), device.rig.id),
        stream_({.target = daemon.target(), .rig = device.rig.id},
                [this](const Acknowledgement& ack) { OnAck(ack); }) {}

  // Waits until all segments are scored and all runs have ended.
  absl::Status Run(double timeout_s) {
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

 private:
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
    while (next_ < device_.segments.size() &&
           stream_.statistics().queued - acknowledged_ < 8 &&
           stream_.Send(device_.segments[next_])) {
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
    absl::StatusOr<std::vector<v1::Table>> tables = view_.GetTables();
    if (!tables.ok()) return tables.status();
    const std::int64_t scored = tables->empty() ? 0 : tables->front().scored();
    const std::size_t total = device_.segments.size();
    report_->Progress(
        fmt::format("sent {}/{}  durable {}  scored {}  tables: {}",
                    next_,
                    total,
                    acknowledged_.load(),
                    scored,
                    Fill(*tables)),
        scored != last_scored_);
    last_scored_ = scored;
    absl::StatusOr<bool> idle = WatchRuns();
    if (!idle.ok()) return idle.status();
    return *idle && next_ == total && static_cast<std::size_t>(scored) == total;
  }

  // Follows every new run to its end; true if there was none.
  absl::StatusOr<bool> WatchRuns() {
    absl::StatusOr<std::vector<v1::Recalibration>> runs = view_.GetRuns();
    if (!runs.ok()) return runs.status();
    bool idle = true;
    for (auto run = runs->rbegin(); run != runs->rend(); ++run) {
      if (!seen_runs_.insert(run->name()).second) continue;
      idle = false;  // look again: its end may start the next
      report_->Line(fmt::format("triggered by {}: {}",
                                run->trigger() == v1::Recalibration::TABLES_FULL
                                    ? "full tables"
                                    : "changed tables",
                                run->name()));
      if (absl::Status status = FollowRun(view_, run->name(), report_);
          !status.ok()) {
        return status;
      }
    }
    return idle;
  }

 public:
  static absl::Status FollowRun(DaemonView& view,
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
    if (last.state() != v1::Recalibration::SUCCEEDED) {
      report->Fail(fmt::format("{} ended without a calibration", name));
    }
    return absl::OkStatus();
  }

 private:
  const Device& device_;
  Report* const report_;
  DaemonView view_;
  std::size_t next_ = 0;
  std::int64_t last_scored_ = -1;
  std::atomic<std::uint64_t> acknowledged_ = 0;
  std::mutex mutex_;
  std::vector<std::string> rejections_;  // guarded by mutex_
  std::set<std::string> seen_runs_;
  SegmentStream stream_;  // last: its callback uses the others
};

template <typename Message>
bool Same(const std::vector<Message>& a, const std::vector<Message>& b) {
  using google::protobuf::util::MessageDifferencer;
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!MessageDifferencer::Equals(a[i], b[i])) return false;
  }
  return true;
}

// The newest active version; the factory's if no run was accepted.
const v1::Calibration& Active(const DaemonState& state) {
  for (const v1::Calibration& calibration : state.calibrations) {
    if (calibration.state() == v1::Calibration::ACTIVE) return calibration;
  }
  return state.calibrations.front();
}

void ShowResult(const DaemonState& state,
                const Device& device,
                Report* report) {
  const v1::Calibration& active = Active(state);
  report->Step("result",
               fmt::format("version {} of {} is active",
                           active.version(),
                           state.calibrations.size()));
  for (const v1::Calibration& calibration : state.calibrations) {
    for (const std::string& reason : calibration.reasons()) {
      report->Line(fmt::format(
          "version {} was rejected: {}", calibration.version(), reason));
    }
  }
  if (active.version() == 1) {
    report->Fail("no recalibration was accepted");
    return;
  }
  report->Result(state.calibrations.front(), active, device.truth);
}

// Starts a run manually, for a recording that is too short to fill the tables.
absl::Status RecalibrateByHand(DaemonView& view, Report* report) {
  report->Step("by hand",
               "the tables did not fill: a recalibration on what they hold");
  absl::StatusOr<v1::Recalibration> run = view.StartRun();
  if (!run.ok()) return run.status();
  return Streaming::FollowRun(view, run->name(), report);
}

absl::Status KillAndCompare(const DemoOptions& options,
                            const Device& device,
                            const DaemonState& before,
                            std::unique_ptr<DaemonProcess> daemon,
                            Report* report) {
  report->Step("kill -9", fmt::format("SIGKILL to pid {}", daemon->pid()));
  daemon->Kill();
  auto again = DaemonProcess::Start(options.daemon, options.state_dir);
  if (!again.ok()) return again.status();
  report->Line(fmt::format("started again, pid {}", (*again)->pid()));
  DaemonView view((*again)->target(), device.rig.id);
  absl::StatusOr<DaemonState> after = view.GetState();
  if (!after.ok()) return after.status();
  const auto compare = [&](const char* what, const auto& a, const auto& b) {
    if (Same(a, b)) {
      report->Line(fmt::format("{} {} as they were", a.size(), what));
    } else {
      report->Fail(fmt::format("the {} are not as they were", what));
    }
  };
  compare("segments and their scores", before.segments, after->segments);
  compare("tables", before.tables, after->tables);
  compare("calibration versions", before.calibrations, after->calibrations);
  return absl::OkStatus();
}

}  // namespace

absl::Status RunDemo(const DemoOptions& options,
                     const Device& device,
                     Report* report) {
  report->Step("device",
               fmt::format("{}; {}",
                           device.description,
                           CountText(device.segments.size(), "segment")));
  auto daemon = DaemonProcess::Start(options.daemon, options.state_dir);
  if (!daemon.ok()) return daemon.status();
  report->Step("daemon",
               fmt::format("selfcald, pid {}, state in {}",
                           (*daemon)->pid(),
                           options.state_dir));
  DaemonView view((*daemon)->target(), device.rig.id);
  if (absl::Status status = view.CreateRig(device.rig); !status.ok()) {
    return status;
  }
  report->Step("stream",
               fmt::format("rigs/{}: its factory calibration is version 1",
                           device.rig.id));
  absl::Status status =
      Streaming(**daemon, device, report).Run(options.timeout_s);
  if (!status.ok()) return status;

  absl::StatusOr<DaemonState> state = view.GetState();
  if (!state.ok()) return state.status();
  report->Step("scores", "what each segment says about each group");
  report->Segments(state->segments);
  report->Tables(state->tables);
  if (state->calibrations.size() == 1) {
    status = RecalibrateByHand(view, report);
    if (!status.ok()) return status;
    state = view.GetState();
    if (!state.ok()) return state.status();
  }
  ShowResult(*state, device, report);
  return KillAndCompare(options, device, *state, *std::move(daemon), report);
}

}  // namespace selfcal::client
