// Observations of one camera with everything that predicts them. Internal to
// core/preflight.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/camera.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/preflight/exposure_poses.h"

namespace selfcal {

struct View {
  BodyPose pose;  // at the exposure of the pixel
  // The first keyframe of the segment that observed the landmark, with any
  // camera: its pose, that at the exposure, and the camera.
  BodyPose first;
  BodyPose first_exposure;
  int first_camera;
  Eigen::Vector3d p;  // position of the landmark as received
  Eigen::Vector2d z_px;
};

// An even subsample of about 4000 observations of `camera`, without invalid
// numbers or indices. The states of each segment hold later than their stamps
// by that of late_s.
std::vector<View> CollectViews(const Rig& rig,
                               const Calibration& theta,
                               std::span<const MotionSegment> segments,
                               std::span<const double> late_s,
                               int camera);

// Pixel of a point in G; nullopt if it cannot be projected.
std::optional<Eigen::Vector2d> Predict(const CameraCalibration& camera,
                                       const BodyPose& pose,
                                       const Eigen::Vector3d& p_G);

// Distance of the pixel from that of a point in G; infinite if it cannot be
// projected.
double ErrorOf(const View& view,
               const CameraCalibration& camera,
               const Eigen::Vector3d& p_G);

// Error of predicted views: one that cannot be projected is treated as
// infinitely far away.
struct ReprojectionError {
  double median_px = 0;
  double in_front = 0;  // share that can be projected
};

ReprojectionError Summarise(std::vector<double> errors_px);

// `place` maps a view to the position of its landmark in G.
template <typename Place>
ReprojectionError Measure(const std::vector<View>& views,
                          const CameraCalibration& camera,
                          const Place& place) {
  std::vector<double> errors;
  errors.reserve(views.size());
  for (const View& view : views) {
    errors.push_back(ErrorOf(view, camera, place(view)));
  }
  return Summarise(std::move(errors));
}

}  // namespace selfcal
