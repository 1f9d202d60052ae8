#include "client/demo/stream_device.h"

#include <fmt/format.h>

#include <numbers>
#include <vector>

#include "client/demo/daemon_view.h"
#include "client/demo/stream_segments.h"
#include "client/text/estimate_text.h"
#include "client/text/text.h"
#include "proto/convert.h"

namespace selfcal::client {
namespace {

// "; its camera turned by 0.5 deg" for a change, or empty.
std::string ChangeText(const CameraChange& change) {
  std::string text;
  if (change.turn_rad != 0) {
    text += fmt::format("; its camera turned by {:.3g} deg",
                        change.turn_rad * 180 / std::numbers::pi);
  }
  if (change.focal_relative != 0) {
    text += fmt::format("; its focal lengths {:+.3g} %",
                        100 * change.focal_relative);
  }
  return text;
}

}  // namespace

absl::Status StreamDevice(const StreamOptions& options, Report* report) {
  const Device device = SimulatedDevice(options.rig, options.use.seed);
  DaemonView view(options.target, options.rig);
  const absl::Status created = view.CreateRig(device.rig);
  if (!created.ok() && !absl::IsAlreadyExists(created)) return created;
  absl::StatusOr<v1::Calibration> active = view.GetActive();
  if (!active.ok()) return active.status();
  Calibration theta_slam;
  if (!FromProto(active->parameters(), "", &theta_slam).empty()) {
    return absl::InternalError("the daemon's calibration cannot be read");
  }
  const auto segments =
      SimulateUse(device, options.use, theta_slam, active->version());
  if (!segments.ok()) return segments.status();
  report->Step("device",
               fmt::format("a simulated hand-held device, seed {}{}",
                           options.use.seed,
                           ChangeText(options.use.change)));
  report->Step("stream",
               fmt::format("rigs/{}: session {}, {}, on version {}",
                           options.rig,
                           options.use.session,
                           CountText(segments->size(), "segment"),
                           active->version()));
  const auto runs = StreamSegments(
      options.target, options.rig, *segments, options.timeout_s, report);
  if (!runs.ok()) return runs.status();
  active = view.GetActive();
  if (!active.ok()) return active.status();
  report->Step(
      "result",
      fmt::format(
          "version {} is active: {}", active->version(), VerdictText(*active)));
  return absl::OkStatus();
}

}  // namespace selfcal::client
