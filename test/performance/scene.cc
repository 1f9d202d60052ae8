#include "test/performance/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

Scene MakeScene(const SceneOptions& options) {
  constexpr std::uint64_t kSeed = 1;
  constexpr double kExcitation = 0.5;
  SimulationOptions simulation;
  simulation.seed = kSeed;
  simulation.keyframes_per_segment = options.keyframes;
  simulation.landmarks_in_view = options.landmarks_in_view;
  simulation.mean_track_length = 20;
  simulation.max_track_length = options.max_track_length;
  simulation.revisit_fraction = options.revisit_fraction;
  Scene scene;
  scene.rig = HandheldRig("benchmark");
  if (options.readout_s > 0) {
    CameraCalibration& camera = scene.rig.factory.cameras[0];
    camera.line_delay_s = options.readout_s / camera.height_px;
    scene.rig.groups = DefaultGroups(scene.rig.blocks, scene.rig.factory);
  }
  const Calibration truth = scene.rig.factory;
  scene.rig.factory = PerturbCalibration(truth, {}, kSeed);
  const int count = (options.segments - 1) * options.every + 1;
  const double duration_s =
      (count * options.keyframes + 1) / simulation.keyframe_rate_hz;
  SimulatedSession session =
      Simulate(scene.rig,
               truth,
               scene.rig.factory,
               *MakeHandheld(duration_s, kExcitation, kSeed),
               "benchmark",
               simulation);
  for (int i = 0; i < count; i += options.every) {
    scene.segments.push_back(std::move(session.segments.at(i)));
  }
  return scene;
}

std::string Describe(const Scene& scene) {
  const MotionSegment& segment = scene.segments.front();
  std::vector<int> tracks(segment.landmarks.size());
  for (const Observation& o : segment.observations) ++tracks[o.landmark];
  return fmt::format(
      "{} keyframes, {} landmarks, {} observations ({} inliers), tracks of {} "
      "on average and up to {}, {} IMU samples, theta of {}",
      segment.keyframes.size(),
      segment.landmarks.size(),
      segment.observations.size(),
      Select(scene, segment).inliers.size(),
      fmt::format("{:.1f}",
                  static_cast<double>(segment.observations.size()) /
                      static_cast<double>(segment.landmarks.size())),
      *std::max_element(tracks.begin(), tracks.end()),
      segment.imu.size(),
      TangentSize(scene.rig.factory));
}

InlierSelection Select(const Scene& scene, const MotionSegment& segment) {
  return SelectInliers(scene.rig, scene.rig.factory, segment, ScoreOptions());
}

}  // namespace selfcal
