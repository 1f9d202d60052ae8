#include "client/demo/demo.h"

#include <fmt/format.h>
#include <google/protobuf/util/message_differencer.h>

#include <memory>
#include <utility>

#include "client/demo/daemon_view.h"
#include "client/demo/stream_segments.h"
#include "client/process/daemon_process.h"
#include "client/text/text.h"

namespace selfcal::client {
namespace {

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

// Reports runs that ended without a version as failures.
void RequireSuccess(const v1::Recalibration& run, Report* report) {
  if (run.state() == v1::Recalibration::SUCCEEDED) return;
  report->Fail(fmt::format("{} ended without a calibration", run.name()));
}

// Starts a run manually, for a recording that is too short to fill the tables.
absl::Status RecalibrateByHand(DaemonView& view, Report* report) {
  report->Step("by hand",
               "the tables did not fill: a recalibration on what they hold");
  absl::StatusOr<v1::Recalibration> run = view.StartRun();
  if (!run.ok()) return run.status();
  run = FollowRun(view, run->name(), report);
  if (!run.ok()) return run.status();
  RequireSuccess(*run, report);
  return absl::OkStatus();
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
  const auto runs = StreamSegments((*daemon)->target(),
                                   device.rig.id,
                                   device.segments,
                                   options.timeout_s,
                                   report);
  if (!runs.ok()) return runs.status();
  for (const v1::Recalibration& run : *runs) RequireSuccess(run, report);

  absl::StatusOr<DaemonState> state = view.GetState();
  if (!state.ok()) return state.status();
  report->Step("scores", "what each segment says about each group");
  report->Segments(state->segments);
  report->Tables(state->tables);
  if (state->calibrations.size() == 1) {
    if (absl::Status status = RecalibrateByHand(view, report); !status.ok()) {
      return status;
    }
    state = view.GetState();
    if (!state.ok()) return state.status();
  }
  ShowResult(*state, device, report);
  return KillAndCompare(options, device, *state, *std::move(daemon), report);
}

}  // namespace selfcal::client
