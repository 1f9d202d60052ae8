// The IMU's matrices in the frames and triangular forms that tools use.
//
// Any pair of readings gyro = G w_B, accel = A f_B in a body frame B can be
// written with triangular matrices, because a matrix is the product of a
// triangular matrix with positive diagonal and a rotation in exactly one way.
// The body frame of a tool depends on which of its matrices has no rotation of
// its own: selfcal rotates B so that G is upper triangular (B = I); Kalibr and
// Basalt rotate it so that A is lower triangular.
#pragma once

#include <Eigen/Core>

#include "core/model/calibration.h"

namespace selfcal::client {

// M = triangular * R with a positive diagonal and det R = 1. FormatError unless
// det M is positive; otherwise axes of the IMU are missing or mirrored.
struct Factors {
  Eigen::Matrix3d triangular;
  Eigen::Matrix3d R;
};
Factors LowerFactors(const Eigen::Matrix3d& M);
Factors UpperFactors(const Eigen::Matrix3d& M);

// Readings in a body frame B: gyro = G w_B + G_f f_B + b_g and
// accel = A f_B + b_a, with axis j of the accelerometer at the position r_j in
// B. What is optional is zero where an IMU lacks it.
struct ImuMatrices {
  Eigen::Matrix3d G;
  Eigen::Matrix3d A;
  Eigen::Matrix3d G_f = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d r = Eigen::Matrix3d::Zero();  // columns r_x, r_y, r_z [m]
};

// The same IMU in selfcal's form, with the orientation of its frame I; it has
// the optional blocks that are not zero.
struct ImuInBody {
  ImuCalibration imu;
  Eigen::Matrix3d R_IB;
};
ImuInBody FromMatrices(const ImuMatrices& matrices);

// The IMU in the frame B in which the accelerometer's matrix is lower
// triangular.
struct AccelFrame {
  ImuMatrices matrices;
  Eigen::Matrix3d R_BI;
};
AccelFrame ToAccelFrame(const ImuCalibration& imu);

// T_CI as a matrix, and a camera from one. B and I have the same origin.
Eigen::Matrix4d TransformFromBody(const CameraCalibration& camera,
                                  const Eigen::Matrix3d& R_BI);
void SetTransformFromBody(const Eigen::Matrix4d& T_CB,
                          const Eigen::Matrix3d& R_BI,
                          CameraCalibration* camera);

// The inverse of a rigid transform.
Eigen::Matrix4d RigidInverse(const Eigen::Matrix4d& T);

}  // namespace selfcal::client
