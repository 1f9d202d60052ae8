// theta, the calibration parameters of a device, as one value with a tangent
// space of named components.
//
// Order of the tangent, LinkTangentSize + sum over cameras of (6 + 4 +
// distortion + 1 to 3) + slopes components:
//   imu: s_g 3, m_g 3, s_a 3, m_a 3, q_AI 3, and those that it has of
//   g-sensitivity 9 and position of the accelerometer 3 or 9;
//   imu1, if there is a second IMU: the same, then q_JI 3, p_JI 3, time offset
//   1; for each camera: q_CI 3, p_CI 3, f 2, c 2, distortion n, time offset 1,
//   line delay 1 if its shutter is a rolling one, and time drift 1 if its clock
//   drifts;
//   slopes with temperature, those that it has: of the imu, of imu1, of each
//   camera.
// Rotations are perturbed on the right (so3.h); all other components are
// additive. Source: Schneider et al., ICRA 2017, sections III-B and III-C; the
// time offset and all optional parts are extensions.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "core/model/camera.h"

namespace selfcal {

// Limits the memory that one calibration from a client can claim.
inline constexpr int kMaxCameras = 16;

// Largest time offset of a second IMU [s]: kImuPadding_s leaves room for it.
inline constexpr double kMaxSecondOffset_s = 0.1;

// Offset of each block in the IMU's tangent; parameter_blocks.h checks them.
inline constexpr int kGyroScale = 0;
inline constexpr int kGyroMisalignment = kGyroScale + 3;
inline constexpr int kAccelScale = kGyroMisalignment + 3;
inline constexpr int kAccelMisalignment = kAccelScale + 3;
inline constexpr int kAccelRotation = kAccelMisalignment + 3;
// Sizes of the tangent of an IMU without optional blocks, which follow, and
// with all of them.
inline constexpr int kImuTangentSize = kAccelRotation + 3;
inline constexpr int kMaxImuTangentSize = kImuTangentSize + 9 + 9;
// The pose of a second IMU and its time offset follow its intrinsics.
inline constexpr int kMountPoseSize = 6;
inline constexpr int kMountTangentSize = kMountPoseSize + 1;
inline constexpr int kMaxLinkTangentSize =
    2 * kMaxImuTangentSize + kMountTangentSize;
// Offset of each block in a camera's tangent.
inline constexpr int kCameraRotation = 0;
inline constexpr int kCameraPosition = kCameraRotation + 3;
inline constexpr int kCameraIntrinsics = kCameraPosition + 3;
inline constexpr int kCameraDistortion = kCameraIntrinsics + 4;
// The largest size of a camera's tangent.
inline constexpr int kMaxCameraTangentSize =
    kCameraIntrinsics + kMaxIntrinsics + 3;

// theta_i. At the angular rate w [rad/s] and acceleration dw/dt of the body and
// the specific force f_I at its origin, axis j of the accelerometer feels, at
// its position r_j,
//   f_j = f_I + w x (w x r_j) + dw/dt x r_j,
// and reads e_j^T T_a R_AI f_j + b_a_j. The gyroscope reads T_g w + T_s f + b_g
// with f the force that the accelerometer reads, R_IA T_a^-1 (accel - b_a).
struct ImuCalibration {
  Eigen::Vector3d s_g = Eigen::Vector3d::Ones();  // [-]
  Eigen::Vector3d m_g = Eigen::Vector3d::Zero();  // [-]
  Eigen::Vector3d s_a = Eigen::Vector3d::Ones();  // [-]
  Eigen::Vector3d m_a = Eigen::Vector3d::Zero();  // [-]
  Eigen::Quaterniond q_AI = Eigen::Quaterniond::Identity();
  // T_s, 9, row by row [rad/s per m/s^2]; without it, zero.
  OptionalVector gyro_g_sensitivity;
  // Positions in I [m]: 3, of all axes, or 9, of the axes x, y, z of A; without
  // it, zero.
  OptionalVector accel_position;
  // Slopes of the above with temperature (temperature.h), per kelvin: of the
  // rotation as a rotation vector in I [rad/K]; without values, zero.
  OptionalVector s_g_slope, m_g_slope, s_a_slope, m_a_slope, q_AI_slope;

  // Upper triangular: scales on the diagonal, m = (m_x, m_y, m_z) at (0,1),
  // (0,2), (1,2).
  Eigen::Matrix3d T_g() const;
  Eigen::Matrix3d T_a() const;
  Eigen::Matrix3d T_s() const;
  // Columns r_x, r_y, r_z.
  Eigen::Matrix3d AccelPositions() const;
};

// The second IMU of a rig: its intrinsics in its own frame J, that of its
// gyroscope, with I replaced by J above; and its pose. T_JI takes a point from
// I to J, as T_CI of a camera takes it to C.
struct SecondImuCalibration : ImuCalibration {
  Eigen::Quaterniond q_JI = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p_JI = Eigen::Vector3d::Zero();  // [m]
  // t_imu - t_imu1 [s]: readings stamped t are of the time t + time_offset_s.
  double time_offset_s = 0;
};

inline constexpr double kDefaultReferenceTemperature_c = 25;

struct Calibration {
  ImuCalibration imu;  // defines I
  std::optional<SecondImuCalibration> imu1 = std::nullopt;
  std::vector<CameraCalibration> cameras;
  // Temperature [deg C] at which the values hold whose slopes it has; constant,
  // not estimated.
  double reference_temperature_c = kDefaultReferenceTemperature_c;
};

// One component of the tangent. The names and units come from
// parameter_blocks.h; every table, message and export uses this list.
struct TangentComponent {
  std::string name;  // "imu.gyro.scale.x", "cam0.focal.x", "cam0.p_CI.x"
  std::string unit;  // "-", "rad", "m", "px", "s"
  // Expected standard deviation after one reference segment, in `unit`. It is
  // the same for all axes of a block, so that an entropy does not depend on the
  // orientation of a frame.
  double sigma_ref;
};

// Dimension of the tangent of a calibration.
int TangentSize(const Calibration& theta);

// Dimension of the tangent of an IMU without its slopes and its mount; that of
// the first IMU is the first part of the tangent of theta.
int ImuTangentSize(const ImuCalibration& imu);

// Dimension of the tangent of all IMUs without slopes, on which inertial
// factors depend: the first part of that of theta.
int LinkTangentSize(const Calibration& theta);

// Dimension of the tangent of camera j without its slopes, and its offset in
// that of theta.
int CameraTangentSize(const CameraCalibration& camera);
int CameraTangentOffset(const Calibration& theta, int camera);
// Returns true if the clock of any camera drifts
// (CameraCalibration::time_drift).
bool HasTimeDrift(const Calibration& theta);

// Index of the time offset of camera j, which line delay and drift follow.
int TimeOffsetComponent(const Calibration& theta, int camera);

// The components in the order of the tangent.
std::vector<TangentComponent> TangentComponents(const Calibration& theta);

// theta [+] delta; delta has TangentSize(theta) entries.
Calibration BoxPlus(const Calibration& theta, const Eigen::VectorXd& delta);

// a [-] b, the delta with b [+] delta = a. Both must have the same cameras,
// distortion models and optional blocks (SameShape). Rotations give
// Log(R_b^T R_a).
Eigen::VectorXd BoxMinus(const Calibration& a, const Calibration& b);

// Derivative of (reference [+] d) [-] theta with respect to d, at
// theta = reference [+] d. It is the identity except for the right Jacobians of
// rotations. Its inverse transports knowledge about the offset from one point
// to the offset from another.
Eigen::MatrixXd ThetaByOffset(const Calibration& reference,
                              const Eigen::VectorXd& d);

// The same IMUs, the same number of cameras, each with the same distortion
// model, the same optional blocks, and the same reference temperature if there
// are slopes.
bool SameShape(const Calibration& a, const Calibration& b);

// Images of the same size; both must have the same number of cameras.
bool SameImages(const Calibration& a, const Calibration& b);

// Value of each component for display: the scalar itself, and for a rotation
// the component of its rotation vector Log(q) [rad]. Order as in the tangent.
Eigen::VectorXd ReadableValues(const Calibration& theta);

}  // namespace selfcal
