#include "test/evaluation/corruptions.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/model/camera.h"
#include "core/model/so3.h"
#include "core/simulation/random.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kSceneStream = 201;
constexpr std::uint64_t kSampleStream = 202;
constexpr std::uint64_t kDivergenceStream = 203;

bool InsideImage(const CameraCalibration& camera, const Eigen::Vector2d& z_px) {
  return z_px.x() >= 0 && z_px.y() >= 0 && z_px.x() <= camera.width_px - 1 &&
         z_px.y() <= camera.height_px - 1;
}

// Keyframes [begin, end) with what they see.
MotionSegment Keep(const MotionSegment& segment, int begin, int end) {
  MotionSegment kept = segment;
  kept.keyframes.assign(segment.keyframes.begin() + begin,
                        segment.keyframes.begin() + end);
  kept.observations.clear();
  for (Observation observation : segment.observations) {
    if (observation.keyframe < begin || observation.keyframe >= end) continue;
    observation.keyframe -= begin;
    kept.observations.push_back(observation);
  }
  return kept;
}

}  // namespace

MotionSegment ShiftStamps(const MotionSegment& segment, double late_s) {
  MotionSegment shifted = segment;
  const std::int64_t late_ns = std::llround(late_s * 1e9);
  for (KeyframeState& state : shifted.keyframes) state.t_ns += late_ns;
  int begin = 0;
  int end = static_cast<int>(shifted.keyframes.size());
  while (begin < end &&
         shifted.keyframes[begin].t_ns < shifted.imu.front().t_ns) {
    ++begin;
  }
  while (end > begin &&
         shifted.keyframes[end - 1].t_ns > shifted.imu.back().t_ns) {
    --end;
  }
  return Keep(shifted, begin, end);
}

MotionSegment SwapCameras(const MotionSegment& segment,
                          const Calibration& theta) {
  MotionSegment swapped = segment;
  swapped.observations.clear();
  for (Observation observation : segment.observations) {
    if (observation.camera < 2) observation.camera = 1 - observation.camera;
    const CameraCalibration& camera = theta.cameras[observation.camera];
    if (InsideImage(camera, observation.z_px)) {
      swapped.observations.push_back(observation);
    }
  }
  return swapped;
}

MotionSegment MoveScene(const MotionSegment& segment,
                        const MotionSegment& truth,
                        const Calibration& theta_true,
                        const SceneMotion& motion,
                        std::uint64_t seed) {
  Random random(seed, kSceneStream);
  const Eigen::Vector3d velocity_mps = motion.speed_mps * random.Direction();
  std::vector<char> moves(segment.landmarks.size());
  for (char& moving : moves) moving = random.Chance(motion.part);
  std::vector<std::int64_t> since_ns(segment.landmarks.size(), -1);
  for (const Observation& observation : segment.observations) {
    std::int64_t& since = since_ns[observation.landmark];
    const std::int64_t t_ns = segment.keyframes[observation.keyframe].t_ns;
    since = since < 0 ? t_ns : std::min(since, t_ns);
  }
  MotionSegment moved = segment;
  moved.observations.clear();
  for (std::size_t i = 0; i < segment.observations.size(); ++i) {
    Observation observation = segment.observations[i];
    if (!moves[observation.landmark]) {
      moved.observations.push_back(observation);
      continue;
    }
    const KeyframeState& x = truth.keyframes[observation.keyframe];
    const CameraCalibration& camera = theta_true.cameras[observation.camera];
    const double dt_s =
        static_cast<double>(x.t_ns - since_ns[observation.landmark]) * 1e-9;
    const Eigen::Vector3d p_G =
        truth.landmarks[observation.landmark].p_G + dt_s * velocity_mps;
    const Eigen::Vector3d p_C =
        camera.q_CI * (x.q_GI.conjugate() * (p_G - x.p_GI)) + camera.p_CI;
    Eigen::Vector2d z_px;
    if (!Project(camera, p_C, &z_px, nullptr)) continue;
    observation.z_px += z_px - truth.observations[i].z_px;
    if (InsideImage(camera, observation.z_px)) {
      moved.observations.push_back(observation);
    }
  }
  return moved;
}

MotionSegment LoseScale(const MotionSegment& segment, double factor) {
  MotionSegment scaled = segment;
  for (KeyframeState& state : scaled.keyframes) {
    state.p_GI *= factor;
    state.v_GI *= factor;
  }
  for (Landmark& landmark : scaled.landmarks) landmark.p_G *= factor;
  return scaled;
}

MotionSegment CorruptGyroSample(const MotionSegment& segment,
                                double value_radps,
                                std::uint64_t seed) {
  Random random(seed, kSampleStream);
  MotionSegment corrupt = segment;
  const std::size_t quarter = corrupt.imu.size() / 4;
  const std::size_t sample = quarter + random.Index(2 * quarter + 1);
  const auto axis = static_cast<Eigen::Index>(random.Index(3));
  corrupt.imu[sample].gyro[axis] = value_radps;
  return corrupt;
}

std::vector<MotionSegment> Diverge(const std::vector<MotionSegment>& session,
                                   const Divergence& divergence,
                                   std::uint64_t seed) {
  Random random(seed, kDivergenceStream);
  std::vector<MotionSegment> diverged = session;
  // What takes a true point of G to where the filter has it now.
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  std::int64_t last_ns = session.front().keyframes.front().t_ns;
  for (MotionSegment& segment : diverged) {
    std::vector<char> placed(segment.landmarks.size());
    std::vector<std::vector<int>> seen(segment.keyframes.size());
    for (const Observation& observation : segment.observations) {
      seen[observation.keyframe].push_back(observation.landmark);
    }
    for (std::size_t k = 0; k < segment.keyframes.size(); ++k) {
      KeyframeState& state = segment.keyframes[k];
      const double dt_s = static_cast<double>(state.t_ns - last_ns) * 1e-9;
      last_ns = state.t_ns;
      const double step = std::sqrt(dt_s);
      q = (Exp(step * divergence.rotation_rad * random.Normal3()) * q)
              .normalized();
      p += step * divergence.position_m * random.Normal3();
      for (const int landmark : seen[k]) {
        if (std::exchange(placed[landmark], 1)) continue;
        Eigen::Vector3d& p_G = segment.landmarks[landmark].p_G;
        p_G = q * p_G + p;
      }
      state.q_GI = (q * state.q_GI).normalized();
      state.p_GI = q * state.p_GI + p;
      state.v_GI = q * state.v_GI + divergence.velocity_mps * random.Normal3();
      state.b_a += divergence.accel_bias_mps2 * random.Normal3();
      state.b_g += divergence.gyro_bias_radps * random.Normal3();
    }
  }
  return diverged;
}

}  // namespace selfcal
