#include "test/client/c/cxx11_session.h"

#include <stdexcept>
#include <thread>
#include <utility>

#include "client/c/selfcal.hpp"

namespace selfcal {
namespace testing_c {
namespace {

ClientOptions Options(const std::string& target) {
  ClientOptions options;
  options.target = target;
  options.rig = "device";
  options.min_backoff = std::chrono::milliseconds(1);
  return options;
}

}  // namespace

Cxx11Outcome StreamInCxx11(const std::string& target, const Session& session) {
  Cxx11Outcome outcome;
  BuilderOptions walk;
  walk.session = "walk";
  walk.keyframes = 12;
  walk.calibration_version = 3;
  walk.first_index = 1;
  Builder made(walk);
  Builder builder(std::move(made));
  Stream first(Options(target), [&outcome](const Acknowledgement& ack) {
    if (ack.verdict == SELFCAL_STORED) outcome.stored.push_back(ack.index);
    if (ack.index == 1) throw std::runtime_error("a bug");
  });
  Stream stream(Options(target));
  stream = std::move(first);
  auto sample = session.imu.begin();
  builder.SetTemperature(21.5);
  for (const Keyframe& keyframe : session.keyframes) {
    for (; sample != session.imu.end() && sample->t_ns <= keyframe.state.t_ns;
         ++sample) {
      builder.AddImu(*sample);
      builder.AddSecondImu(*sample);
    }
    builder.AddKeyframe(keyframe.state, keyframe.observations);
    while (Segment segment = builder.Take()) stream.Send(std::move(segment));
  }
  for (; sample != session.imu.end(); ++sample) {
    builder.AddImu(*sample);
    builder.AddSecondImu(*sample);
  }
  builder.Flush(2);
  while (Segment segment = builder.Take()) stream.Send(std::move(segment));
  outcome.drained = stream.Drain(std::chrono::seconds(60)).code();
  outcome.statistics_stored = stream.statistics().stored;
  outcome.callback_failures = stream.statistics().callback_failures;
  outcome.next_index = builder.next_index();
  return outcome;
}

Cxx11Calibration WatchInCxx11(const std::string& target) {
  Cxx11Calibration seen;
  std::atomic<std::uint64_t> callbacks(0);
  const Watch watch(Options(target),
                    [&callbacks](const Calibration&) { ++callbacks; });
  Calibration calibration;
  for (int wait = 0; wait < 60000 && callbacks == 0; ++wait) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  calibration = watch.Newest();
  if (!calibration) return seen;
  seen.callbacks = callbacks;
  seen.version = calibration.version();
  seen.verdict = calibration.verdict();
  seen.reasons = calibration.reasons();
  seen.focal_x = calibration.camera(0).f[0];
  seen.model = calibration.camera(0).model;
  for (const selfcal_component& component : calibration.components()) {
    seen.sigmas.push_back(component.sigma);
  }
  seen.covariance = calibration.covariance();
  const double ahead[3] = {0.1, 0.2, 1};
  const double behind[3] = {0.1, 0.2, -1};
  calibration.Project(0, ahead, seen.z_px);
  double ignored[2];
  seen.behind = calibration.Project(0, behind, ignored);
  try {
    calibration.camera(7);
  } catch (const Error& error) {
    seen.code = error.code();
  }
  return seen;
}

std::string ErrorInCxx11() {
  try {
    const Stream stream((ClientOptions()));
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace testing_c
}  // namespace selfcal
