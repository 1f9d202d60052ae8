#include "test/client/tracking/recording_kinds.h"

#include <Eigen/Geometry>
#include <stdexcept>

#include "core/model/so3.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

RecordingKind Kind(const std::string& name, const Rig& rig) {
  RecordingKind kind;
  kind.name = name;
  kind.rig = rig;
  return kind;
}

}  // namespace

Rig StereoPairRig() {
  Rig rig = HandheldRig("stereo-pair");
  CameraCalibration left = rig.factory.cameras[0];
  left.f = {400, 399};
  left.c = {322, 237};
  left.model = DistortionModel::kRadialTangential;
  left.distortion = Eigen::Vector4d(-0.28, 0.07, 2e-4, 2e-5);
  CameraCalibration right = left;
  right.q_CI = Exp({0.004, -0.006, 0.003}) * left.q_CI;
  right.p_CI.x() -= 0.11;
  right.f = {401, 402};
  right.c = {316, 243};
  rig.factory.cameras = {left, right};
  return rig;
}

std::vector<RecordingKind> RecordingKinds() {
  const Rig mono = HandheldRig("handheld");
  const Rig stereo = StereoPairRig();
  std::vector<RecordingKind> kinds;
  kinds.push_back(Kind("mono", mono));
  kinds.push_back(Kind("mono-unaligned", mono));
  kinds.back().tracker.align = false;
  kinds.push_back(Kind("calm", mono));
  kinds.back().excitation = 0.2;
  kinds.push_back(Kind("blur-8ms", mono));
  kinds.back().render.exposure_s = 8e-3;
  kinds.push_back(Kind("blur-20ms", mono));
  kinds.back().render.exposure_s = 20e-3;
  kinds.push_back(Kind("rolling-30ms", mono));
  kinds.back().rig.factory.cameras[0].line_delay_s = 30e-3 / 480;
  kinds.push_back(Kind("gain", mono));
  kinds.back().render.sensor.gain_amplitude = 0.4;
  kinds.back().render.sensor.gain_period_s = 1;
  kinds.push_back(Kind("dark", mono));
  kinds.back().render.sensor.full_well_e = 500;
  kinds.push_back(Kind("moving", mono));
  kinds.back().render.scene.moving_boxes = 10;
  kinds.push_back(Kind("moving-unchecked", mono));
  kinds.back().render.scene.moving_boxes = 10;
  kinds.back().tracker.check_epipolar = false;
  kinds.push_back(Kind("unchecked", mono));
  kinds.back().tracker.check_epipolar = false;
  kinds.back().tracker.align = false;
  kinds.back().tracker.flow.max_return_px = 1e3;
  kinds.push_back(Kind("wrong-start", mono));
  kinds.back().start = WrongStart;
  kinds.push_back(Kind("stereo", stereo));
  kinds.push_back(Kind("stereo-wrong-start", stereo));
  kinds.back().start = WrongStart;
  return kinds;
}

RecordingKind KindNamed(const std::string& name) {
  for (RecordingKind& kind : RecordingKinds()) {
    if (kind.name == name) return std::move(kind);
  }
  throw std::invalid_argument("no kind of recording '" + name + "'");
}

RenderedRecording Render(const RecordingKind& kind,
                         double seconds,
                         std::uint64_t seed) {
  RenderOptions options = kind.render;
  options.seed = seed;
  return {kind.rig, MakeHandheld(seconds, kind.excitation, seed), options};
}

}  // namespace selfcal
