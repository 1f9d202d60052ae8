// Map from the received landmark positions to those in G that match the
// observations of the camera. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/model/camera.h"
#include "core/preflight/views.h"

namespace selfcal {

// p_G = scale R p + t.
struct LandmarkMap {
  double scale = 1;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& p) const {
    return scale * (R * p) + t;
  }
};

// Fits an affine map p_G = A p + t that moves each landmark onto the rays that
// observe it: linear in (A, t), b x (A p + t - c) = 0 for the ray from c along
// b; reweighted a few times. Returns nullopt if it is not a map between frames
// (A must be a scaled rotation within a twentieth), or the rays do not
// determine it.
std::optional<LandmarkMap> FitLandmarkMap(const std::vector<View>& views,
                                          const CameraCalibration& camera);

}  // namespace selfcal
