// From where the landmarks were fed to where they must be in G for the camera
// to see them as it did. Internal to core/preflight.
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

// An affine map p_G = A p + t that brings each landmark onto the rays that see
// it: linear in (A, t), b x (A p + t - c) = 0 for the ray from c along b;
// weighted anew a few times. Nothing if it is no map of one frame to another
// (A must be a scaled rotation to a twentieth), or the rays do not determine
// it.
std::optional<LandmarkMap> FitLandmarkMap(const std::vector<View>& views,
                                          const CameraCalibration& camera);

}  // namespace selfcal
