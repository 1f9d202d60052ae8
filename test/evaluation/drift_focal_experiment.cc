// A focal length that grows by 1 px in ten minutes of calm and excited motion:
// how far it has come when that is found.
#include <cmath>
#include <optional>
#include <vector>

#include "core/change/detect_change.h"
#include "test/evaluation/change_device.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kFocalDriftFirstDevice = 42000;  // seeds of their own
constexpr int kLongest = 90;                   // segments
constexpr double kDrift_px_s = 1.0 / 600;

struct FocalDriftOutcome {
  double sigma_px = 0;  // of the active calibration
  std::optional<double> found_px;
  bool group = false;
  bool drift = false;
};

FocalDriftOutcome Run(int index) {
  const ChangeDevice device =
      MakeChangeDevice(index, *MakeMixed(12 * kChangeSegment_s + 0.5, index));
  const auto components = TangentComponents(device.truth);
  const int focal = MatchComponents(components, {"cam0.focal.x"}).at(0);
  const double px = kDrift_px_s * kChangeSegment_s;
  const DeviceChange drift{
      "drift", "camera", true, 0, px / device.truth.cameras[0].f(0)};
  const ConsistencyTester tester(device.rig, device.active);
  const ChangeUse use(device, kLongest, index);
  FocalDriftOutcome outcome;
  outcome.sigma_px = std::sqrt(device.active.covariance(focal, focal));
  std::vector<OffsetInformation> newest;
  for (int n = 1; n <= kLongest; ++n) {
    newest.push_back(tester.Offset(
        ScoreSegment(device.rig,
                     device.active.theta,
                     use.Segment(n - 1, drift.After(device.truth, n)))));
    const auto change = DetectChange(tester, newest);
    if (!change) continue;
    outcome.found_px = n * px;
    outcome.group = change->concerned == std::vector{drift.group};
    outcome.drift = change->kind == ChangeKind::kDrift;
    break;
  }
  return outcome;
}

}  // namespace

void RunDriftFocal(Context* context) {
  const int devices = context->quick() ? 1 : 8;
  std::vector<FocalDriftOutcome> all(devices);
  context->ForEach(devices,
                   [&](int i) { all[i] = Run(kFocalDriftFirstDevice + i); });
  ResultTable table({"device",
                     "sigma of the active calibration [px]",
                     "found at [px]",
                     "in its sigmas",
                     "camera alone concerned",
                     "told as drift"});
  std::vector<double> found, sigmas;
  for (int i = 0; i < devices; ++i) {
    const double px =
        all[i].found_px.value_or(2 * kLongest * kDrift_px_s * kChangeSegment_s);
    found.push_back(px);
    sigmas.push_back(px / all[i].sigma_px);
    table.Add({static_cast<long>(i),
               all[i].sigma_px,
               all[i].found_px ? Cell(px) : Cell(),
               px / all[i].sigma_px,
               static_cast<long>(all[i].group),
               static_cast<long>(all[i].drift)});
  }
  context->WriteTable("drift_focal", table);
  context->AtMost("drift_focal.mean", Mean(found), 0.4, {.unit = "px"});
  context->AtMost(
      "drift_focal.mean_in_sigmas_of_the_active_calibration", Mean(sigmas), 3);
}

}  // namespace selfcal
