// Observations of one camera with everything that predicts them. Internal to
// core/preflight.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/model/camera.h"
#include "core/model/segment.h"

namespace selfcal {

struct BodyPose {
  Eigen::Quaterniond q_GI;
  Eigen::Vector3d p_GI;

  Eigen::Vector3d ToG(const Eigen::Vector3d& p_I) const {
    return q_GI * p_I + p_GI;
  }
};

struct View {
  BodyPose pose;  // of the observing keyframe
  // Pose of the first keyframe of the segment that observed the landmark, with
  // any camera, and the camera that did.
  BodyPose first;
  int first_camera;
  Eigen::Vector3d p;  // position of the landmark as received
  Eigen::Vector2d z_px;
};

// An even subsample of about 4000 observations of `camera`, without invalid
// numbers or indices; there are `cameras` in all.
std::vector<View> CollectViews(std::span<const MotionSegment> segments,
                               int camera,
                               int cameras);

// Pixel of a point in G; nullopt if it cannot be projected.
std::optional<Eigen::Vector2d> Predict(const CameraCalibration& camera,
                                       const BodyPose& pose,
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
    const auto z = Predict(camera, view.pose, place(view));
    errors.push_back(z ? (*z - view.z_px).norm() : HUGE_VAL);
  }
  return Summarise(std::move(errors));
}

}  // namespace selfcal
