// Cameras of any registered model, behind one interface.
//
// A model maps a point p_C (camera frame, z forward, any positive scale) to
// coordinates d, and these have the pixel
//   z_x = f_x d_x + c_x,   z_y = f_y d_y + c_y.
// A pinhole distorts u = (x/z, y/z): d = distort(u). Each model is a separate
// file (distortion_fov.h, camera_unified.h, ...) with its mathematics;
// camera_models.h lists them all. In the models that are not pinholes, rays at
// 90 degrees from the axis and beyond have an image, too: a point in front of a
// camera is one that lies on the ray of its pixel, at a positive distance. Pure
// functions, callable from any thread. A point that cannot be projected is
// reported by the return value, never as a NaN.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <string_view>

namespace selfcal {

// A registered model, projection included: its index in the list of
// camera_models.h. Those that code refers to have an enumerator.
enum class DistortionModel : int {
  kFov,               // w: Devernay and Faugeras 2001
  kRadialTangential,  // k1 k2 p1 p2: Brown
  kEquidistant,       // k1 k2 k3 k4: Kannala and Brandt, beyond 90 degrees
};

// The value of an optional block: of size 0 if the sensor lacks it. Stored
// without allocation.
inline constexpr int kMaxOptionalSize = 9;
using OptionalVector =
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxOptionalSize, 1>;

// Room for the coefficients of every model, so that none are allocated.
inline constexpr int kMaxDistortion = 8;
inline constexpr int kMaxIntrinsics = 4 + kMaxDistortion;

// Number of coefficients of a model.
int DistortionSize(DistortionModel model);

// "fov", "radial-tangential", "equidistant", ...
std::string_view DistortionName(DistortionModel model);

// Coefficients of a model, at most kMaxDistortion, stored without allocation.
using DistortionVector =
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDistortion, 1>;

// theta_c of the paper, and constants of the sensor.
struct CameraCalibration {
  // T_CI: takes a point from the body frame I to the camera frame C.
  Eigen::Quaterniond q_CI = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p_CI = Eigen::Vector3d::Zero();  // [m], origin of I in C
  Eigen::Vector2d f = Eigen::Vector2d::Ones();     // [px]
  Eigen::Vector2d c = Eigen::Vector2d::Zero();     // [px]
  DistortionModel model = DistortionModel::kFov;
  DistortionVector distortion = DistortionVector::Zero(1);
  // t_imu = t_camera + time_offset_s: an image with the timestamp t was exposed
  // at t + time_offset_s on the clock of the IMU.
  double time_offset_s = 0;
  // Time from one row to the next of a rolling shutter: row v of an image is
  // exposed v line_delay_s after its first one, to whose exposure the timestamp
  // refers. Without a value, all rows are exposed at once.
  std::optional<double> line_delay_s;
  // Drift of the clock of the camera [s/s]: time_offset_s is the offset where
  // the session begins (MotionSegment), and time_drift more each second later.
  // Without a value, none.
  std::optional<double> time_drift;
  // Slopes of the above with temperature (temperature.h), per kelvin: of the
  // rotation as a rotation vector in I [rad/K]; without values, zero.
  OptionalVector q_CI_slope, p_CI_slope;
  OptionalVector f_slope, c_slope;
  OptionalVector distortion_slope;
  OptionalVector time_offset_slope;  // of size 1 [s/K]
  int width_px = 0;                  // of the image; constant, not estimated
  int height_px = 0;

  // Size of (f, c, distortion): the number of columns of d z / d intrinsics.
  int IntrinsicsSize() const { return 4 + static_cast<int>(distortion.size()); }
};

// Derivatives of the pixel coordinates, in px per unit of the argument.
struct ProjectionJacobians {
  Eigen::Matrix<double, 2, 3> point;  // dz / dp_C
  // Derivative with respect to (f_x, f_y, c_x, c_y, distortion): 2 x
  // IntrinsicsSize().
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxIntrinsics> intrinsics;
};

// Projects p_C to the pixel *z_px, and fills *jacobians unless it is null.
// Returns false and changes neither for a point outside the region in which the
// model is one-to-one (for a pinhole, also within 1e-6 rad of the camera plane
// or behind it), and for points or parameters that are not finite or are beyond
// any physical value. It does not check the borders of the image.
bool Project(const CameraCalibration& camera,
             const Eigen::Vector3d& p_C,
             Eigen::Vector2d* z_px,
             ProjectionJacobians* jacobians);

// Computes the unit bearing in C of a pixel: the inverse of Project up to
// scale. Returns false and does not change *bearing_C for a pixel to which no
// point projects.
bool Unproject(const CameraCalibration& camera,
               const Eigen::Vector2d& z_px,
               Eigen::Vector3d* bearing_C);

// Offset of the clocks [s] a time after the session began.
double TimeOffsetAt(const CameraCalibration& camera, double session_s);

// Time from the timestamp of an image to the exposure of its middle row [s], a
// time after the session began.
double MiddleRowDelay(const CameraCalibration& camera, double session_s);

// Scales along x and y in the middle of the image [px/rad], which are f for
// most models.
Eigen::Vector2d PixelsPerRadian(const CameraCalibration& camera);

}  // namespace selfcal
