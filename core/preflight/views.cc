#include "core/preflight/views.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/model/median.h"

namespace selfcal {
namespace {

constexpr std::size_t kMaxViews = 4000;

using First = const Observation*;

// First observation of each landmark.
std::vector<First> FirstSightings(const MotionSegment& segment, int cameras) {
  const auto order = [](const Observation& o) {
    return std::pair(o.keyframe, o.camera);
  };
  std::vector<First> first(segment.landmarks.size(), nullptr);
  for (const Observation& o : segment.observations) {
    if (o.camera < 0 || o.camera >= cameras || !IsUsable(segment, o)) continue;
    First& of = first[o.landmark];
    if (of == nullptr || order(o) < order(*of)) of = &o;
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

std::vector<View> CollectViews(const Rig& rig,
                               const Calibration& theta,
                               std::span<const MotionSegment> segments,
                               std::span<const double> late_s,
                               int camera) {
  const auto cameras = static_cast<int>(theta.cameras.size());
  const std::size_t step = CountOf(segments, camera) / kMaxViews + 1;
  std::vector<View> views;
  std::size_t count = 0;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    const MotionSegment& segment = segments[s];
    const ExposurePoses poses(rig, theta, segment, late_s[s]);
    const auto first = FirstSightings(segment, cameras);
    for (const Observation& o : segment.observations) {
      if (o.camera != camera || !IsUsable(segment, o)) continue;
      if (count++ % step != 0) continue;
      const Observation& sighting = *first[o.landmark];
      views.push_back({poses.At(o),
                       PoseOf(segment.keyframes[sighting.keyframe]),
                       poses.At(sighting),
                       sighting.camera,
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

double ErrorOf(const View& view,
               const CameraCalibration& camera,
               const Eigen::Vector3d& p_G) {
  const auto z_px = Predict(camera, view.pose, p_G);
  return z_px ? (*z_px - view.z_px).norm() : HUGE_VAL;
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
