#include "core/preflight/views.h"

#include <algorithm>
#include <cmath>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/model/median.h"

namespace selfcal {
namespace {

constexpr std::size_t kMaxViews = 4000;

bool Usable(const MotionSegment& segment, const Observation& o) {
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

BodyPose PoseOf(const KeyframeState& state) {
  return {state.q_GI.normalized(), state.p_GI};
}

struct Sighting {
  std::int32_t keyframe = std::numeric_limits<std::int32_t>::max();
  std::int32_t camera = 0;
  auto operator<=>(const Sighting&) const = default;
};

// First observation of each landmark.
std::vector<Sighting> FirstSightings(const MotionSegment& segment,
                                     int cameras) {
  std::vector<Sighting> first(segment.landmarks.size());
  for (const Observation& o : segment.observations) {
    if (o.camera < 0 || o.camera >= cameras || !Usable(segment, o)) continue;
    first[o.landmark] =
        std::min(first[o.landmark], Sighting{o.keyframe, o.camera});
  }
  return first;
}

std::size_t CountOf(std::span<const MotionSegment> segments, int camera) {
  std::size_t count = 0;
  for (const MotionSegment& segment : segments) {
    for (const Observation& o : segment.observations) {
      count += o.camera == camera ? 1 : 0;
    }
  }
  return count;
}

}  // namespace

std::vector<View> CollectViews(std::span<const MotionSegment> segments,
                               int camera,
                               int cameras) {
  const std::size_t step = CountOf(segments, camera) / kMaxViews + 1;
  std::vector<View> views;
  std::size_t count = 0;
  for (const MotionSegment& segment : segments) {
    const auto first = FirstSightings(segment, cameras);
    for (const Observation& o : segment.observations) {
      if (o.camera != camera || !Usable(segment, o)) continue;
      if (count++ % step != 0) continue;
      views.push_back({PoseOf(segment.keyframes[o.keyframe]),
                       PoseOf(segment.keyframes[first[o.landmark].keyframe]),
                       first[o.landmark].camera,
                       segment.landmarks[o.landmark].p_G,
                       o.z_px});
    }
  }
  return views;
}

std::optional<Eigen::Vector2d> Predict(const CameraCalibration& camera,
                                       const BodyPose& pose,
                                       const Eigen::Vector3d& p_G) {
  const Eigen::Vector3d p_I = pose.q_GI.conjugate() * (p_G - pose.p_GI);
  Eigen::Vector2d z_px;
  if (!Project(camera, camera.q_CI * p_I + camera.p_CI, &z_px, nullptr)) {
    return std::nullopt;
  }
  return z_px;
}

ReprojectionError Summarise(std::vector<double> errors_px) {
  if (errors_px.empty()) return {HUGE_VAL, 0};
  const auto finite = std::count_if(errors_px.begin(),
                                    errors_px.end(),
                                    [](double e) { return std::isfinite(e); });
  return {UpperMedian(errors_px),
          static_cast<double>(finite) / static_cast<double>(errors_px.size())};
}

}  // namespace selfcal
