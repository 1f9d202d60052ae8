#include "core/simulation/point_views.h"

#include <cmath>

namespace selfcal {
namespace {

// A tracked landmark may come nearer, or move farther, than the depths of new
// ones by this factor.
constexpr double kDepthSlack = 2;
// A point that keeps up with the rows of a rolling shutter is in many of them:
// it is not observed.
constexpr int kMaxRowIterations = 50;
constexpr double kRowConverged_px = 1e-9;

}  // namespace

bool InsideImage(const CameraCalibration& camera, const Eigen::Vector2d& z_px) {
  return z_px.x() >= 0 && z_px.y() >= 0 && z_px.x() <= camera.width_px - 1 &&
         z_px.y() <= camera.height_px - 1;
}

bool PointViews::Sees(int camera,
                      int keyframe,
                      const Eigen::Vector3d& p_G,
                      Eigen::Vector2d* z_px) const {
  const CameraCalibration& c = theta_.cameras[camera];
  double row_px = c.height_px / 2.0;
  // A rolling shutter sees the point in the row at whose exposure it is there.
  for (int i = 0; i < kMaxRowIterations; ++i) {
    const KeyframeState x = exposures_.At(camera, keyframe, row_px);
    const Eigen::Vector3d p_I = x.q_GI.conjugate() * (p_G - x.p_GI);
    const Eigen::Vector3d p_C = c.q_CI * p_I + c.p_CI;
    const double depth_m = p_C.norm();
    if (!(depth_m > options_.min_depth_m / kDepthSlack &&
          depth_m < options_.max_depth_m * kDepthSlack &&
          Project(c, p_C, z_px, nullptr) && InsideImage(c, *z_px))) {
      return false;
    }
    if (!exposures_.IsRolling(camera) ||
        std::abs(z_px->y() - row_px) < kRowConverged_px) {
      return true;
    }
    row_px = z_px->y();
  }
  return false;
}

bool PointViews::PointAt(int camera,
                         int keyframe,
                         const Eigen::Vector2d& z_px,
                         double depth_m,
                         Eigen::Vector3d* p_G) const {
  const CameraCalibration& c = theta_.cameras[camera];
  Eigen::Vector3d bearing_C;
  if (!Unproject(c, z_px, &bearing_C)) return false;
  const Eigen::Vector3d p_I =
      c.q_CI.conjugate() * (depth_m * bearing_C - c.p_CI);
  const KeyframeState x = exposures_.At(camera, keyframe, z_px.y());
  *p_G = x.q_GI * p_I + x.p_GI;
  return true;
}

}  // namespace selfcal
