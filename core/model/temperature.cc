#include "core/model/temperature.h"

#include <map>
#include <string>
#include <type_traits>
#include <variant>

#include "core/model/parameter_blocks.h"
#include "core/model/rig.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

// Calls visit(value, slope) for each slope that a sensor has.
template <class Slopes, class Sensor, class Visitor>
void VisitSlopesOf(const Slopes& slopes, Sensor& sensor, const Visitor& visit) {
  using Plain = std::remove_const_t<Sensor>;
  for (const auto& block : slopes) {
    auto& slope = sensor.*std::get<OptionalVector Plain::*>(block.value);
    if (slope.size() == 0) continue;
    std::visit([&](auto value) { visit(sensor.*value, slope); }, block.of);
  }
}

ImuCalibration& AsImu(SecondImuCalibration& imu) { return imu; }
const ImuCalibration& AsImu(const SecondImuCalibration& imu) { return imu; }

template <class Theta, class Visitor>
void VisitSlopes(Theta& theta, const Visitor& visit) {
  VisitSlopesOf(kImuSlopes, theta.imu, visit);
  if (theta.imu1) {
    auto& imu1 = AsImu(*theta.imu1);
    VisitSlopesOf(kImuSlopes, imu1, visit);
  }
  for (auto& camera : theta.cameras) {
    VisitSlopesOf(kCameraSlopes, camera, visit);
  }
}

void Move(const Eigen::VectorXd& by, Eigen::Quaterniond* q) {
  *q = (*q * Exp(by)).normalized();
}
void Move(const Eigen::VectorXd& by, double* value) { *value += by[0]; }
template <class Vector>
void Move(const Eigen::VectorXd& by, Vector* v) {
  *v += by;
}

// The place of a block that may have a slope.
struct Place {
  int offset;
  bool is_rotation;
};

}  // namespace

bool HasSlopes(const Calibration& theta) {
  bool has = false;
  VisitSlopes(theta, [&](const auto&, const OptionalVector&) { has = true; });
  return has;
}

Calibration AtTemperature(const Calibration& theta, double temperature_c) {
  const double apart_k = temperature_c - theta.reference_temperature_c;
  Calibration at = theta;
  VisitSlopes(at, [&](auto& value, OptionalVector& slope) {
    Move(apart_k * slope, &value);
    slope.resize(0);
  });
  return at;
}

double TemperatureOf(const Calibration& theta, const MotionSegment& segment) {
  return segment.temperature_c.value_or(theta.reference_temperature_c);
}

SegmentTheta::SegmentTheta(const Calibration& theta,
                           const MotionSegment& segment)
    : SegmentTheta(theta, TemperatureOf(theta, segment)) {}

SegmentTheta::SegmentTheta(const Calibration& theta, double temperature_c)
    : theta_(theta) {
  if (HasSlopes(theta)) at_ = AtTemperature(theta, temperature_c);
}

Eigen::MatrixXd CovarianceAtTemperature(const Calibration& theta,
                                        const Eigen::MatrixXd& covariance,
                                        double temperature_c) {
  if (!HasSlopes(theta)) return covariance;
  const Eigen::MatrixXd derivative =
      TemperatureDerivative(theta, temperature_c);
  return derivative * covariance * derivative.transpose();
}

std::string TemperatureFault(const Calibration& theta, double temperature_c) {
  const SegmentLimits limits;
  // The comparison is false for NaN.
  if (!(temperature_c >= limits.min_temperature_c &&
        temperature_c <= limits.max_temperature_c)) {
    return std::to_string(temperature_c) +
           " is not the temperature of a device; send degrees Celsius";
  }
  if (!HasSlopes(theta)) return "";
  const auto faults = Validate(AtTemperature(theta, temperature_c), "");
  if (faults.empty()) return "";
  return "is so far from the reference temperature that the slopes lead to an "
         "impossible calibration: " +
         faults.front().field + " " + faults.front().message;
}

Eigen::MatrixXd TemperatureDerivative(const Calibration& theta,
                                      double temperature_c) {
  const double apart_k = temperature_c - theta.reference_temperature_c;
  const int cameras = static_cast<int>(theta.cameras.size());
  const int without = CameraTangentOffset(theta, cameras);
  Eigen::MatrixXd derivative =
      Eigen::MatrixXd::Identity(without, TangentSize(theta));
  std::map<std::string, Place> places;
  VisitBlocks(
      [&]<class Value>(const BlockPlace& place, const Value& value) {
        if (place.offset < without) {
          places[place.Name()] = {place.offset,
                                  std::is_same_v<Value, Eigen::Quaterniond>};
          return;
        }
        if constexpr (std::is_same_v<Value, OptionalVector>) {
          std::string name = place.Name();
          name.resize(name.size() - kSlopeSuffix.size());
          const Place& of = places.at(name);
          const Eigen::Index size = value.size();
          auto by_slope = derivative.block(of.offset, place.offset, size, size);
          by_slope = apart_k * Eigen::MatrixXd::Identity(size, size);
          if (!of.is_rotation) return;
          const Eigen::Vector3d turn = apart_k * value;
          by_slope = apart_k * RightJacobian(turn);
          derivative.block<3, 3>(of.offset, of.offset) =
              Exp(turn).toRotationMatrix().transpose();
        }
      },
      theta);
  return derivative;
}

}  // namespace selfcal
