#include "test/evaluation/change_device.h"

#include <numbers>
#include <stdexcept>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"
#include "test/evaluation/estimators.h"

namespace selfcal {
namespace {

constexpr int kActiveSegments = 8;
constexpr double kMargin_s = 0.5;  // for the last keyframe

// A part of a longer motion.
class Stretch final : public Trajectory {
 public:
  Stretch(const Trajectory& whole, double begin_s, double duration_s)
      : whole_(whole), begin_s_(begin_s), duration_s_(duration_s) {}
  double duration_s() const override { return duration_s_; }
  BodyMotion At(double t_s) const override { return whole_.At(begin_s_ + t_s); }

 private:
  const Trajectory& whole_;
  const double begin_s_;
  const double duration_s_;
};

}  // namespace

ChangeDevice MakeChangeDevice(int index) {
  return MakeChangeDevice(
      index,
      *MakeHandheld(
          kActiveSegments * kChangeSegment_s + kMargin_s, 0.7, 1000 + index));
}

ChangeDevice MakeChangeDevice(int index, const Trajectory& motion) {
  ChangeDevice device{HandheldRig("device"), {}, {}};
  device.truth = device.rig.factory;
  device.rig.factory = PerturbCalibration(device.truth, {}, index + 1);
  SimulationOptions options;
  options.seed = 1000 + index;
  // As in datasets.h: else each keyframe has to be eliminated against all.
  options.revisit_fraction = 0;
  const auto session = Simulate(
      device.rig, device.truth, device.rig.factory, motion, "active", options);
  const CalibrationResult result = Calibrate(
      device.rig, device.rig.factory, session.segments, ComparedOptions());
  if (result.status != CalibrateStatus::kConverged) {
    throw std::runtime_error("the active calibration: " + result.message);
  }
  device.active = {result.theta, result.covariance, result.track_noise_factor};
  return device;
}

Calibration DeviceChange::After(const Calibration& before, int n) const {
  const double share = drift ? n : 1;
  return ChangeCamera(before,
                      {.turn_rad = share * turn_deg * std::numbers::pi / 180,
                       .focal_relative = share * focal_relative});
}

ChangeUse::ChangeUse(const ChangeDevice& device,
                     int segments,
                     std::uint64_t seed)
    : device_(device),
      seed_(seed),
      motion_(MakeMixed(segments * kChangeSegment_s + kMargin_s, seed)) {}

MotionSegment ChangeUse::Segment(int i, const Calibration& truth) const {
  SimulationOptions options;
  options.seed = 1000 * seed_ + i;
  const Stretch stretch(
      *motion_, i * kChangeSegment_s, kChangeSegment_s + kMargin_s);
  return Simulate(device_.rig,
                  truth,
                  device_.active.theta,
                  stretch,
                  "use-" + std::to_string(i),
                  options)
      .segments.front();
}

}  // namespace selfcal
