// Calibrations and states of selfcal in the terms of Basalt.
//
// Basalt corrects readings by
//
//   f = (1 + M_a) accel - b_static,   w = (1 + M_g) gyro - b_static,
//
// with M_a lower triangular and M_g full, and subtracts the biases of its state
// afterwards. Its body frame B is therefore the one in which the matrix of the
// accelerometer is lower triangular. With selfcal's
//
//   gyro = T_g w_I + b_g,   accel = T_a R_AI f_I + b_a,
//
// T_a R_AI = L R_BI is the product of a lower triangle and a rotation, and
//
//   1 + M_a = L^-1,   1 + M_g = R_BI T_g^-1,
//   b_a = L b_accel,  b_g = T_g R_BI^T b_gyro,
//
// where b_accel and b_gyro are the biases of Basalt's state, and b_static is 0.
// B and I have the same origin.
//
// Licence: Apache-2.0. The file includes headers of Basalt, which is under the
// 3-clause BSD licence.
#pragma once

#include <basalt/imu/imu_types.h>

#include <Eigen/Dense>
#include <basalt/calibration/calibration.hpp>
#include <basalt/camera/generic_camera.hpp>
#include <cmath>
#include <cstdint>
#include <selfcal/selfcal.hpp>
#include <sophus/se3.hpp>
#include <stdexcept>
#include <string>

namespace selfcal {
namespace basalt {

using BasaltCalibration = ::basalt::Calibration<double>;
using BasaltState = ::basalt::PoseVelBiasState<double>;

inline std::int64_t Nanoseconds(double seconds) {
  return std::llround(1e9 * seconds);
}

template <typename Vector>
void Copy(const Vector& from, double* to) {
  for (Eigen::Index i = 0; i < from.size(); ++i) to[i] = from[i];
}

inline Eigen::Vector3d VectorOf(const double (&values)[3]) {
  return Eigen::Map<const Eigen::Vector3d>(values);
}

inline Eigen::Quaterniond EigenOf(const Quaternion& q) {
  return Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized();
}

inline Quaternion QuaternionOf(const Eigen::Quaterniond& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

// An IMU in Basalt's body frame B.
struct BodyFrame {
  Eigen::Matrix3d L = Eigen::Matrix3d::Identity();  // accel = L f_B + b_a
  Eigen::Matrix3d G = Eigen::Matrix3d::Identity();  // gyro = G w_B + b_g
  Eigen::Matrix3d R_BI = Eigen::Matrix3d::Identity();
};

inline Eigen::Matrix3d UpperTriangle(const double (&scale)[3],
                                     const double (&misalignment)[3]) {
  Eigen::Matrix3d matrix;
  matrix << scale[0], misalignment[0], misalignment[1], 0, scale[1],
      misalignment[2], 0, 0, scale[2];
  return matrix;
}

inline BodyFrame BodyFrameOf(const selfcal_imu& imu) {
  const Eigen::Matrix3d A =
      UpperTriangle(imu.accel_scale, imu.accel_misalignment) *
      EigenOf(imu.q_AI).toRotationMatrix();
  // A^T = Q U, so that A = U^T Q^T; the signs make the diagonal positive.
  const Eigen::HouseholderQR<Eigen::Matrix3d> qr(A.transpose());
  const Eigen::Matrix3d U =
      qr.matrixQR().triangularView<Eigen::Upper>().toDenseMatrix();
  const Eigen::Matrix3d Q = qr.householderQ();
  const Eigen::Vector3d signs =
      (U.diagonal().array() < 0).select(-Eigen::Vector3d::Ones(), 1);
  BodyFrame frame;
  frame.L = U.transpose() * signs.asDiagonal();
  frame.R_BI = signs.asDiagonal() * Q.transpose();
  frame.G = UpperTriangle(imu.gyro_scale, imu.gyro_misalignment) *
            frame.R_BI.transpose();
  return frame;
}

// Basalt's rational model contains those with fewer coefficients.
inline bool IsRadialTangential(const std::string& model) {
  return model == "radial-tangential" || model == "radial-tangential-5" ||
         model == "radial-tangential-8";
}

inline bool HasModel(const std::string& model) {
  return IsRadialTangential(model) || model == "equidistant" ||
         model == "extended-unified" || model == "double-sphere";
}

template <typename Lens>
Lens LensOf(const selfcal_camera& camera) {
  typename Lens::VecN values = Lens::VecN::Zero();
  values[0] = camera.f[0];
  values[1] = camera.f[1];
  values[2] = camera.c[0];
  values[3] = camera.c[1];
  for (int i = 0; i < camera.distortion_size; ++i) {
    values[4 + i] = camera.distortion[i];
  }
  return Lens(values);
}

// Throws std::invalid_argument for a model that Basalt does not have.
inline ::basalt::GenericCamera<double> CameraOf(const selfcal_camera& camera) {
  const std::string model = camera.model;
  ::basalt::GenericCamera<double> result;
  if (IsRadialTangential(model)) {
    result.variant = LensOf<::basalt::PinholeRadtan8Camera<double>>(camera);
  } else if (model == "equidistant") {
    result.variant = LensOf<::basalt::KannalaBrandtCamera4<double>>(camera);
  } else if (model == "extended-unified") {
    result.variant = LensOf<::basalt::ExtendedUnifiedCamera<double>>(camera);
  } else if (model == "double-sphere") {
    result.variant = LensOf<::basalt::DoubleSphereCamera<double>>(camera);
  } else {
    throw std::invalid_argument("Basalt has no camera model " + model);
  }
  return result;
}

// Empty, or what of the calibration asks more of each segment than this adapter
// sends: without it, the daemon would refuse all of them.
inline std::string NotSent(const Calibration& calibration) {
  for (const selfcal_component& component : calibration.components()) {
    const std::string name = component.name;
    if (name.rfind("imu1.", 0) == 0) {
      return "the rig has a second IMU, whose readings the adapter does not "
             "send";
    }
    if (name.find("_slope") != std::string::npos) {
      return "the calibration depends on the temperature, which the adapter "
             "does not send (" +
             name + ")";
    }
  }
  return "";
}

// Empty, or what of the calibration Basalt cannot use.
inline std::string NotExpressible(const Calibration& calibration,
                                  std::size_t cameras) {
  const selfcal_imu imu = calibration.imu();
  if (imu.gyro_g_sensitivity_size > 0) {
    return "Basalt has no g-sensitivity of the gyroscope";
  }
  if (imu.accel_position_size > 0) {
    return "Basalt has no position of the accelerometer";
  }
  const std::string not_sent = NotSent(calibration);
  if (!not_sent.empty()) return not_sent;
  if (static_cast<std::size_t>(calibration.camera_count()) != cameras) {
    return "the rig has another number of cameras";
  }
  const double time_offset_s = calibration.camera(0).time_offset_s;
  for (std::int32_t i = 0; i < calibration.camera_count(); ++i) {
    const selfcal_camera camera = calibration.camera(i);
    const std::string name = "camera " + std::to_string(i);
    if (!HasModel(camera.model)) {
      return name + " is of the model " + camera.model;
    }
    if (camera.rolling_shutter != 0) return name + " has a rolling shutter";
    if (camera.clock_drifts != 0) return name + " has a clock that drifts";
    if (std::abs(camera.time_offset_s - time_offset_s) > 1e-4) {
      return name + " has another time offset than camera 0";
    }
  }
  return "";
}

// The calibration with the noise, the rate and the vignette of `base`, which
// selfcal's calibrations lack.
inline BasaltCalibration BasaltCalibrationOf(const Calibration& calibration,
                                             const BasaltCalibration& base) {
  BasaltCalibration result = base;
  const BodyFrame frame = BodyFrameOf(calibration.imu());
  const Eigen::Matrix3d M_a = frame.L.triangularView<Eigen::Lower>().solve(
                                  Eigen::Matrix3d::Identity()) -
                              Eigen::Matrix3d::Identity();
  result.calib_accel_bias.getParam() << 0, 0, 0, M_a(0, 0), M_a(1, 0),
      M_a(2, 0), M_a(1, 1), M_a(2, 1), M_a(2, 2);
  const Eigen::Matrix3d M_g = frame.G.inverse() - Eigen::Matrix3d::Identity();
  result.calib_gyro_bias.getParam() << 0, 0, 0, M_g.col(0), M_g.col(1),
      M_g.col(2);
  result.T_i_c.clear();
  result.intrinsics.clear();
  result.resolution.clear();
  for (std::int32_t i = 0; i < calibration.camera_count(); ++i) {
    const selfcal_camera camera = calibration.camera(i);
    const Eigen::Quaterniond q_CB(EigenOf(camera.q_CI).toRotationMatrix() *
                                  frame.R_BI.transpose());
    const Sophus::SE3d T_CB(q_CB.normalized(), VectorOf(camera.p_CI));
    result.T_i_c.push_back(T_CB.inverse());
    result.intrinsics.push_back(CameraOf(camera));
    result.resolution.emplace_back(camera.width_px, camera.height_px);
  }
  result.cam_time_offset_ns = Nanoseconds(calibration.camera(0).time_offset_s);
  return result;
}

// A state of Basalt's in selfcal's frame and terms, and back.
inline KeyframeState StateOf(const BasaltState& state, const BodyFrame& frame) {
  KeyframeState result = KeyframeState();
  result.t_ns = state.t_ns;
  const Eigen::Quaterniond q_GI(state.T_w_i.so3().matrix() * frame.R_BI);
  result.q_GI = QuaternionOf(q_GI.normalized());
  Copy(state.T_w_i.translation(), result.p_GI);
  Copy(state.vel_w_i, result.v_GI);
  Copy(Eigen::Vector3d(frame.L * state.bias_accel), result.b_a);
  Copy(Eigen::Vector3d(frame.G * state.bias_gyro), result.b_g);
  return result;
}

inline BasaltState BasaltStateOf(const KeyframeState& state,
                                 const BodyFrame& frame) {
  const Eigen::Quaterniond q_GB(EigenOf(state.q_GI).toRotationMatrix() *
                                frame.R_BI.transpose());
  return BasaltState(
      state.t_ns,
      Sophus::SE3d(q_GB.normalized(), VectorOf(state.p_GI)),
      VectorOf(state.v_GI),
      frame.G.inverse() * VectorOf(state.b_g),
      frame.L.triangularView<Eigen::Lower>().solve(VectorOf(state.b_a)));
}

}  // namespace basalt
}  // namespace selfcal
