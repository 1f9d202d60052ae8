#include "core/preflight/exposure_poses.h"

#include <cstddef>
#include <cstdint>

#include "core/preflight/motion_data.h"

namespace selfcal {

BodyPose PoseOf(const KeyframeState& state) {
  return {state.q_GI.normalized(), state.p_GI};
}

bool IsUsable(const MotionSegment& segment, const Observation& o) {
  const auto within = [](std::int32_t i, std::size_t size) {
    return i >= 0 && static_cast<std::size_t>(i) < size;
  };
  if (!within(o.keyframe, segment.keyframes.size())) return false;
  if (!within(o.landmark, segment.landmarks.size())) return false;
  const KeyframeState& k = segment.keyframes[o.keyframe];
  return o.z_px.allFinite() && k.p_GI.allFinite() &&
         k.q_GI.coeffs().allFinite() && k.q_GI.norm() > 0.5 &&
         segment.landmarks[o.landmark].p_G.allFinite();
}

Calibration FromStates(const Calibration& theta, double late_s) {
  Calibration from = theta;
  for (CameraCalibration& camera : from.cameras) {
    camera.time_offset_s -= late_s;
  }
  return from;
}

ExposurePoses::ExposurePoses(const Rig& rig,
                             const Calibration& theta,
                             const MotionSegment& segment,
                             double late_s)
    : segment_(segment), theta_(FromStates(theta, late_s)) {
  const std::vector<ImuSample> samples = UsableSamples(segment.imu);
  if (samples.empty()) return;
  std::vector<KeyframeState> states = segment.keyframes;
  for (KeyframeState& state : states) state.q_GI.normalize();
  motions_.Measure(rig,
                   theta_,
                   std::vector<char>(theta_.cameras.size(), 0),
                   states,
                   [&](std::size_t k) -> KeyframeContext {
                     return {samples, SessionTime(segment, states[k])};
                   });
}

BodyPose ExposurePoses::At(const Observation& o) const {
  const KeyframeState& state = segment_.keyframes[o.keyframe];
  const BodyPose pose = PoseOf(state);
  const KeyframeMotion* const motion = motions_.At(o.keyframe, o.camera);
  if (motion == nullptr || !IsFinite(state)) return pose;
  const ExposurePose exposed =
      MovePose(pose.q_GI, pose.p_GI, *motion, theta_.cameras[o.camera], o.z_px);
  return {exposed.q_GI, exposed.p_GI};
}

}  // namespace selfcal
