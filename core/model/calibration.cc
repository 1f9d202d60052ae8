#include "core/model/calibration.h"

#include <cassert>

#include "core/model/so3.h"

namespace selfcal {
namespace {

Eigen::Matrix3d ScaleAndMisalignment(const Eigen::Vector3d& s,
                                     const Eigen::Vector3d& m) {
  Eigen::Matrix3d T = s.asDiagonal();
  T(0, 1) = m.x();
  T(0, 2) = m.y();
  T(1, 2) = m.z();
  return T;
}

Eigen::Quaterniond Rotated(const Eigen::Quaterniond& q,
                           const Eigen::Vector3d& delta) {
  return (q * Exp(delta)).normalized();
}

}  // namespace

Eigen::Matrix3d ImuCalibration::T_g() const {
  return ScaleAndMisalignment(s_g, m_g);
}

Eigen::Matrix3d ImuCalibration::T_a() const {
  return ScaleAndMisalignment(s_a, m_a);
}

int CameraTangentSize(const CameraCalibration& camera) {
  return kCameraIntrinsics + camera.IntrinsicsSize() + 1;
}

int CameraTangentOffset(const Calibration& theta, int camera) {
  int offset = kImuTangentSize;
  for (int j = 0; j < camera; ++j) {
    offset += CameraTangentSize(theta.cameras[j]);
  }
  return offset;
}

int TimeOffsetComponent(const Calibration& theta, int camera) {
  return CameraTangentOffset(theta, camera + 1) - 1;
}

int TangentSize(const Calibration& theta) {
  return CameraTangentOffset(theta, static_cast<int>(theta.cameras.size()));
}

Calibration BoxPlus(const Calibration& theta, const Eigen::VectorXd& delta) {
  assert(delta.size() == TangentSize(theta));
  Calibration moved = theta;
  ImuCalibration& imu = moved.imu;
  imu.s_g += delta.segment<3>(kGyroScale);
  imu.m_g += delta.segment<3>(kGyroMisalignment);
  imu.s_a += delta.segment<3>(kAccelScale);
  imu.m_a += delta.segment<3>(kAccelMisalignment);
  imu.q_AI = Rotated(imu.q_AI, delta.segment<3>(kAccelRotation));
  int offset = kImuTangentSize;
  for (CameraCalibration& camera : moved.cameras) {
    const auto part = delta.segment(offset, CameraTangentSize(camera));
    camera.q_CI = Rotated(camera.q_CI, part.segment<3>(kCameraRotation));
    camera.p_CI += part.segment<3>(kCameraPosition);
    camera.f += part.segment<2>(kCameraIntrinsics);
    camera.c += part.segment<2>(kCameraIntrinsics + 2);
    camera.distortion +=
        part.segment(kCameraDistortion, camera.distortion.size());
    camera.time_offset_s += part(part.size() - 1);
    offset += CameraTangentSize(camera);
  }
  return moved;
}

Eigen::VectorXd BoxMinus(const Calibration& a, const Calibration& b) {
  assert(SameShape(a, b));
  Eigen::VectorXd delta(TangentSize(b));
  delta.segment<3>(kGyroScale) = a.imu.s_g - b.imu.s_g;
  delta.segment<3>(kGyroMisalignment) = a.imu.m_g - b.imu.m_g;
  delta.segment<3>(kAccelScale) = a.imu.s_a - b.imu.s_a;
  delta.segment<3>(kAccelMisalignment) = a.imu.m_a - b.imu.m_a;
  delta.segment<3>(kAccelRotation) = Log(b.imu.q_AI.conjugate() * a.imu.q_AI);
  int offset = kImuTangentSize;
  for (std::size_t j = 0; j < b.cameras.size(); ++j) {
    const CameraCalibration& to = a.cameras[j];
    const CameraCalibration& from = b.cameras[j];
    auto part = delta.segment(offset, CameraTangentSize(from));
    part.segment<3>(kCameraRotation) = Log(from.q_CI.conjugate() * to.q_CI);
    part.segment<3>(kCameraPosition) = to.p_CI - from.p_CI;
    part.segment<2>(kCameraIntrinsics) = to.f - from.f;
    part.segment<2>(kCameraIntrinsics + 2) = to.c - from.c;
    part.segment(kCameraDistortion, from.distortion.size()) =
        to.distortion - from.distortion;
    part(part.size() - 1) = to.time_offset_s - from.time_offset_s;
    offset += CameraTangentSize(from);
  }
  return delta;
}

Eigen::MatrixXd ThetaByOffset(const Calibration& reference,
                              const Eigen::VectorXd& d) {
  const int size = TangentSize(reference);
  Eigen::MatrixXd derivative = Eigen::MatrixXd::Identity(size, size);
  const auto set_rotation = [&](int offset) {
    derivative.block<3, 3>(offset, offset) =
        RightJacobian(d.segment<3>(offset));
  };
  set_rotation(kAccelRotation);
  for (int j = 0; j < static_cast<int>(reference.cameras.size()); ++j) {
    set_rotation(CameraTangentOffset(reference, j) + kCameraRotation);
  }
  return derivative;
}

bool SameShape(const Calibration& a, const Calibration& b) {
  if (a.cameras.size() != b.cameras.size()) return false;
  for (std::size_t j = 0; j < a.cameras.size(); ++j) {
    if (a.cameras[j].model != b.cameras[j].model) return false;
    if (a.cameras[j].distortion.size() != b.cameras[j].distortion.size()) {
      return false;
    }
  }
  return true;
}

Eigen::VectorXd ReadableValues(const Calibration& theta) {
  // Difference to the calibration in which everything is zero: rotations become
  // Log(q), scalars remain.
  Calibration zero = theta;
  zero.imu.s_g.setZero();
  zero.imu.m_g.setZero();
  zero.imu.s_a.setZero();
  zero.imu.m_a.setZero();
  zero.imu.q_AI.setIdentity();
  for (CameraCalibration& camera : zero.cameras) {
    camera.q_CI.setIdentity();
    camera.p_CI.setZero();
    camera.f.setZero();
    camera.c.setZero();
    camera.distortion.setZero();
    camera.time_offset_s = 0;
  }
  return BoxMinus(theta, zero);
}

}  // namespace selfcal
