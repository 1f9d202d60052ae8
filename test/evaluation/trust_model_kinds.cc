// Devices with an effect that the rig does not have: what is estimated is
// compared with the truth of the rest.
#include <utility>

#include "test/evaluation/trust_kinds.h"
#include "test/evaluation/trust_simulation.h"

namespace selfcal {
namespace {

constexpr double kDelay_s = 2e-3;
constexpr int kSessions = 2;

using Effect = void (*)(Calibration* truth);

// Hand-held, two sessions, with `effect` in the truth of its data.
TrustDevice WithEffect(std::uint64_t seed, Effect effect) {
  TrustDevice device = MakeTrustDevice(seed);
  Calibration truth = *device.truth;
  effect(&truth);
  for (int i = 0; i < kSessions; ++i) {
    const std::uint64_t session_seed =
        kSessions * seed + static_cast<std::uint64_t>(i);
    device.sessions.push_back(
        [=, sensors = device.sensors, known = *device.truth](
            const Calibration& theta_slam) {
          SimulatedSession session =
              Simulate(sensors,
                       truth,
                       theta_slam,
                       *MakeHandheld(kTrustSession_s, 1, session_seed),
                       i == 0 ? "first" : "second",
                       TrustOptions(session_seed));
          // The rest of theta is compared with its truth.
          return TrustSession{std::move(session.segments), known};
        });
  }
  return device;
}

// A poor gyroscope: 0.5 mrad/s for each m/s^2 on and across its axes.
void ReactToForce(Calibration* truth) {
  truth->imu.gyro_g_sensitivity.resize(9);
  truth->imu.gyro_g_sensitivity << 5e-4, -3e-4, 2e-4, 1e-4, -4e-4, 3e-4, -2e-4,
      5e-4, 4e-4;
}

// About their mean, which is where they seem to be together.
void MoveAxesApart(Calibration* truth) {
  truth->imu.accel_position.resize(9);
  truth->imu.accel_position << -0.01, 0.005, -0.005, 0.015, -0.01, 0.0, -0.005,
      0.005, 0.005;
}

void Delay(Calibration* truth) { truth->cameras[0].time_offset_s = kDelay_s; }

void RollShutter(double readout_s, Calibration* truth) {
  CameraCalibration& camera = truth->cameras[0];
  camera.line_delay_s = readout_s / camera.height_px;
}

TrustKind Kind(std::string name,
               std::string about,
               std::uint64_t first_seed,
               int devices,
               Effect effect) {
  return {std::move(name),
          std::move(about),
          first_seed,
          devices,
          0,
          [=](std::uint64_t seed) { return WithEffect(seed, effect); }};
}

}  // namespace

std::vector<TrustKind> ModelKinds() {
  return {
      Kind("g_sensitivity",
           "a gyroscope that reacts to acceleration by 0.5 mrad/s per m/s^2",
           70'000,
           8,
           ReactToForce),
      Kind("accel_position",
           "an accelerometer whose axes lie 2 cm apart",
           71'000,
           8,
           MoveAxesApart),
      Kind("time_offset", "a camera that is late by 2 ms", 72'000, 6, Delay),
      Kind("rolling_shutter",
           "a rolling shutter of 20 ms",
           73'000,
           4,
           [](Calibration* truth) { RollShutter(20e-3, truth); }),
      Kind("rolling_shutter_slight",
           "a rolling shutter of 2 ms",
           74'000,
           6,
           [](Calibration* truth) { RollShutter(2e-3, truth); })};
}

}  // namespace selfcal
