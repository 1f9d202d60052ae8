#include "core/model/image_bounds.h"

#include <algorithm>
#include <vector>

#include "core/model/camera.h"

namespace selfcal {
namespace {

bool IsOutside(const Observation& observation,
               const Calibration& theta,
               const SegmentLimits& limits) {
  return observation.camera >= 0 &&
         static_cast<std::size_t>(observation.camera) < theta.cameras.size() &&
         observation.z_px.allFinite() &&
         !IsInImage(theta.cameras[observation.camera],
                    observation.z_px,
                    limits.pixel_margin_px);
}

}  // namespace

bool IsInImage(const CameraCalibration& camera,
               const Eigen::Vector2d& z_px,
               double margin_px) {
  // Each comparison is false for NaN.
  return z_px.x() >= -margin_px && z_px.y() >= -margin_px &&
         z_px.x() <= camera.width_px + margin_px &&
         z_px.y() <= camera.height_px + margin_px;
}

bool CoversImage(const CameraCalibration& camera, double margin_px) {
  const double x_px[] = {-margin_px, camera.width_px + margin_px};
  const double y_px[] = {-margin_px, camera.height_px + margin_px};
  Eigen::Vector3d bearing_C;
  for (const double x : x_px) {
    for (const double y : y_px) {
      if (!Unproject(camera, {x, y}, &bearing_C)) return false;
    }
  }
  return true;
}

double DistanceToLastRay(const CameraCalibration& camera,
                         const Eigen::Vector2d& z_px,
                         double reach_px) {
  constexpr int kHalvings = 10;
  const Eigen::Vector2d outwards = (z_px - camera.c).normalized();
  Eigen::Vector3d bearing_C;
  const auto has_ray = [&](double distance_px) {
    return Unproject(camera, z_px + distance_px * outwards, &bearing_C);
  };
  if (has_ray(reach_px)) return reach_px;
  double inside_px = 0, beyond_px = reach_px;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle_px = (inside_px + beyond_px) / 2;
    (has_ray(middle_px) ? inside_px : beyond_px) = middle_px;
  }
  return inside_px;
}

std::size_t CountStrayObservations(const MotionSegment& segment,
                                   const Calibration& theta,
                                   const SegmentLimits& limits) {
  const auto& all = segment.observations;
  const auto outside = static_cast<std::size_t>(
      std::count_if(all.begin(), all.end(), [&](const Observation& o) {
        return IsOutside(o, theta, limits);
      }));
  const double most = kMaxOutsideFraction * static_cast<double>(all.size());
  return static_cast<double>(outside) <= most ? outside : 0;
}

void RemoveStrayObservations(const Calibration& theta,
                             const SegmentLimits& limits,
                             MotionSegment* segment) {
  if (CountStrayObservations(*segment, theta, limits) == 0) return;
  std::erase_if(segment->observations, [&](const Observation& o) {
    return IsOutside(o, theta, limits);
  });
}

}  // namespace selfcal
