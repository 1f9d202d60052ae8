#include "core/model/calibration.h"

#include <algorithm>
#include <cassert>
#include <optional>
#include <type_traits>

#include "core/model/parameter_blocks.h"
#include "core/model/so3.h"
#include "core/model/temperature.h"

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

void Add(const Eigen::VectorXd& delta, int offset, Eigen::Quaterniond* q) {
  *q = (*q * Exp(delta.segment<3>(offset))).normalized();
}
void Add(const Eigen::VectorXd& delta, int offset, double* value) {
  *value += delta[offset];
}
void Add(const Eigen::VectorXd& delta,
         int offset,
         std::optional<double>* value) {
  **value += delta[offset];
}
template <class Vector>
void Add(const Eigen::VectorXd& delta, int offset, Vector* v) {
  *v += delta.segment(offset, v->size());
}

Eigen::Vector3d Difference(const Eigen::Quaterniond& a,
                           const Eigen::Quaterniond& b) {
  // Exactly zero also where products and sums are contracted (arm64), which
  // would leave a rounding error: whether a segment was linearised at a
  // calibration is a question of zero or not.
  if (a.coeffs() == b.coeffs()) return Eigen::Vector3d::Zero();
  return Log(b.conjugate() * a);
}
Eigen::Matrix<double, 1, 1> Difference(double a, double b) {
  return Eigen::Matrix<double, 1, 1>(a - b);
}
Eigen::Matrix<double, 1, 1> Difference(const std::optional<double>& a,
                                       const std::optional<double>& b) {
  return Difference(*a, *b);
}
template <class Vector>
Vector Difference(const Vector& a, const Vector& b) {
  return a - b;
}

void SetZero(Eigen::Quaterniond* q) { q->setIdentity(); }
void SetZero(double* value) { *value = 0; }
void SetZero(std::optional<double>* value) { *value = 0; }
template <class Vector>
void SetZero(Vector* v) {
  v->setZero();
}

template <class Sensor, class Blocks>
int SensorTangentSize(const Blocks& blocks, const Sensor& sensor) {
  int size = 0;
  VisitSensorBlocks(
      blocks,
      [&](const BlockInfo&, const auto& value) {
        size += TangentDimension(value);
      },
      sensor);
  return size;
}

}  // namespace

Eigen::Matrix3d ImuCalibration::T_g() const {
  return ScaleAndMisalignment(s_g, m_g);
}

Eigen::Matrix3d ImuCalibration::T_a() const {
  return ScaleAndMisalignment(s_a, m_a);
}

Eigen::Matrix3d ImuCalibration::T_s() const {
  if (gyro_g_sensitivity.size() == 0) return Eigen::Matrix3d::Zero();
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
      gyro_g_sensitivity.data());
}

Eigen::Matrix3d ImuCalibration::AccelPositions() const {
  switch (accel_position.size()) {
    case 3:
      return accel_position.head<3>().rowwise().replicate<3>();
    case 9:
      return Eigen::Map<const Eigen::Matrix3d>(accel_position.data());
    default:
      return Eigen::Matrix3d::Zero();
  }
}

int ImuTangentSize(const ImuCalibration& imu) {
  return SensorTangentSize(kImuBlocks, imu);
}

int LinkTangentSize(const Calibration& theta) {
  const int size = ImuTangentSize(theta.imu);
  return theta.imu1 ? size + ImuTangentSize(*theta.imu1) + kMountTangentSize
                    : size;
}

int CameraTangentSize(const CameraCalibration& camera) {
  return SensorTangentSize(kCameraBlocks, camera);
}

int CameraTangentOffset(const Calibration& theta, int camera) {
  int offset = LinkTangentSize(theta);
  for (int j = 0; j < camera; ++j) {
    offset += CameraTangentSize(theta.cameras[j]);
  }
  return offset;
}

bool HasTimeDrift(const Calibration& theta) {
  return std::any_of(
      theta.cameras.begin(),
      theta.cameras.end(),
      [](const CameraCalibration& camera) { return camera.time_drift; });
}

int TimeOffsetComponent(const Calibration& theta, int camera) {
  return CameraTangentOffset(theta, camera) + kCameraDistortion +
         static_cast<int>(theta.cameras[camera].distortion.size());
}

int TangentSize(const Calibration& theta) {
  int size =
      CameraTangentOffset(theta, static_cast<int>(theta.cameras.size())) +
      SensorTangentSize(kImuSlopes, theta.imu);
  if (theta.imu1) size += SensorTangentSize(kImuSlopes, *theta.imu1);
  for (const CameraCalibration& camera : theta.cameras) {
    size += SensorTangentSize(kCameraSlopes, camera);
  }
  return size;
}

Calibration BoxPlus(const Calibration& theta, const Eigen::VectorXd& delta) {
  assert(delta.size() == TangentSize(theta));
  Calibration moved = theta;
  VisitBlocks([&](const BlockPlace& place,
                  auto& value) { Add(delta, place.offset, &value); },
              moved);
  return moved;
}

Eigen::VectorXd BoxMinus(const Calibration& a, const Calibration& b) {
  assert(SameShape(a, b));
  Eigen::VectorXd delta(TangentSize(b));
  VisitBlocks(
      [&](const BlockPlace& place, const auto& from, const auto& to) {
        delta.segment(place.offset, TangentDimension(from)) =
            Difference(to, from);
      },
      b,
      a);
  return delta;
}

Eigen::MatrixXd ThetaByOffset(const Calibration& reference,
                              const Eigen::VectorXd& d) {
  const int size = TangentSize(reference);
  Eigen::MatrixXd derivative = Eigen::MatrixXd::Identity(size, size);
  VisitBlocks(
      [&]<class Value>(const BlockPlace& place, const Value&) {
        if constexpr (std::is_same_v<Value, Eigen::Quaterniond>) {
          derivative.block<3, 3>(place.offset, place.offset) =
              RightJacobian(d.segment<3>(place.offset));
        }
      },
      reference);
  return derivative;
}

bool SameShape(const Calibration& a, const Calibration& b) {
  if (a.cameras.size() != b.cameras.size()) return false;
  if (a.imu1.has_value() != b.imu1.has_value()) return false;
  bool same = true;
  const auto compare =
      [&](const BlockInfo&, const auto& value, const auto& other) {
        same = same && TangentDimension(value) == TangentDimension(other);
      };
  VisitWithSlopes(compare, a.imu, b.imu);
  if (a.imu1) VisitWithSlopes(compare, *a.imu1, *b.imu1);
  for (std::size_t j = 0; same && j < a.cameras.size(); ++j) {
    if (a.cameras[j].model != b.cameras[j].model) return false;
    VisitWithSlopes(compare, a.cameras[j], b.cameras[j]);
  }
  return same && (a.reference_temperature_c == b.reference_temperature_c ||
                  !HasSlopes(a));
}

bool SameImages(const Calibration& a, const Calibration& b) {
  for (std::size_t j = 0; j < a.cameras.size(); ++j) {
    if (a.cameras[j].width_px != b.cameras[j].width_px ||
        a.cameras[j].height_px != b.cameras[j].height_px) {
      return false;
    }
  }
  return true;
}

Eigen::VectorXd ReadableValues(const Calibration& theta) {
  // Difference to the calibration in which everything is zero: rotations become
  // Log(q), scalars remain.
  Calibration zero = theta;
  VisitBlocks([](const BlockPlace&, auto& value) { SetZero(&value); }, zero);
  return BoxMinus(theta, zero);
}

}  // namespace selfcal
