// Common parts of the cost functions for the block theta: the part of the
// calibration that a factor needs, at an offset from the reference, and
// Jacobians with respect to that offset. Internal to core/factor.
#pragma once

#include <Eigen/Core>

#include "core/model/calibration.h"
#include "core/model/so3.h"

namespace selfcal {

// Converts columns that are derivatives with respect to a rotation's right
// perturbation at R_ref Exp(d) into derivatives with respect to d.
template <class Columns>
void ByRotationOffset(const double* d, Columns&& columns) {
  columns =
      (columns * RightJacobian(Eigen::Map<const Eigen::Vector3d>(d))).eval();
}

// The IMUs of a reference without cameras, at the offset at the beginning of
// the block.
inline Calibration OffsetImus(const Calibration& reference,
                              const double* theta) {
  const Eigen::Map<const Eigen::VectorXd> d(theta, LinkTangentSize(reference));
  return BoxPlus(reference, d);
}

// One camera of the reference, at the offset of its part of the block.
inline CameraCalibration OffsetCamera(const CameraCalibration& reference,
                                      const double* camera_theta) {
  const int size = CameraTangentSize(reference);
  Eigen::VectorXd delta(kImuTangentSize + size);
  delta.head<kImuTangentSize>().setZero();
  delta.tail(size) = Eigen::Map<const Eigen::VectorXd>(camera_theta, size);
  return BoxPlus(Calibration{.imu = {}, .cameras = {reference}}, delta)
      .cameras.front();
}

}  // namespace selfcal
