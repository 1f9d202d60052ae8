#include "core/model/so3.h"
#include "core/simulation/simulate.h"

namespace selfcal {

Calibration ChangeCamera(const Calibration& theta, const CameraChange& change) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 2) / 3;
  Calibration changed = theta;
  CameraCalibration& camera = changed.cameras[0];
  camera.q_CI = (camera.q_CI * Exp(change.turn_rad * axis)).normalized();
  camera.f *= 1 + change.focal_relative;
  return changed;
}

}  // namespace selfcal
