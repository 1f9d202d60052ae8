// Validation of a calibration; all other modules rely on it.
#include <iterator>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "core/model/camera_model.h"
#include "core/model/parameter_blocks.h"
#include "core/model/rig.h"
#include "core/model/too_many.h"
#include "core/model/violation_list.h"

namespace selfcal {
namespace {

constexpr int kMaxImageSize_px = 100'000;

void AddIf(const std::string& field, std::string fault, ViolationList* list) {
  if (!fault.empty()) list->Add(field, std::move(fault));
}

// Describes the fault of numbers that must be positive and at most `limit`.
template <class Vector>
std::string PositiveFault(const Vector& v, double limit) {
  if (!v.allFinite()) return "is not finite";
  if (!(v.minCoeff() > 0)) return "must be positive";
  if (v.maxCoeff() <= limit) return "";
  return Readable(v.maxCoeff()) + " is over the limit of " + Readable(limit);
}

template <class Vector>
std::string SizeFault(const Vector& v, double limit) {
  if (!v.allFinite()) return "is not finite";
  const double largest = v.cwiseAbs().maxCoeff();
  if (largest <= limit) return "";
  return "magnitude " + Readable(largest) + " is over the limit of " +
         Readable(limit);
}

std::string DistortionFault(const CameraCalibration& camera) {
  const int expected = DistortionSize(camera.model);
  if (camera.distortion.size() != expected) {
    return "has " + std::to_string(camera.distortion.size()) +
           " coefficients; the " + std::string(DistortionName(camera.model)) +
           " model has " + std::to_string(expected);
  }
  if (!camera.distortion.allFinite()) return "is not finite";
  for (int i = 0; i < expected; ++i) {
    const CameraCoefficient& coefficient =
        ModelInfo(camera.model).coefficients[i];
    const double value = camera.distortion[i];
    const auto [low, high] = coefficient.valid;
    if (value > low && value < high) continue;
    return std::string(coefficient.name) + " is " + Readable(value) +
           "; it must be between " + Readable(low) + " and " + Readable(high);
  }
  return "";
}

std::string ImageSizeFault(int size_px) {
  if (size_px >= 1 && size_px <= kMaxImageSize_px) return "";
  return std::to_string(size_px) + " is not in [1, " +
         std::to_string(kMaxImageSize_px) + "]";
}

template <class Sensor>
std::string CountFault(const BlockInfo& info, const Sensor& sensor, int count) {
  const auto [first, second] = OptionalSizes(info, sensor);
  if (count == first || count == second) return "";
  return "has " + std::to_string(count) + " values; it may have 0" +
         (second > 0 ? ", " + std::to_string(second) : "") + " or " +
         std::to_string(first);
}

// The fault of the value of a block of a sensor; empty if there is none.
template <class Sensor, class Value>
std::string Fault(const BlockInfo& info,
                  const Sensor& sensor,
                  const Value& value) {
  if constexpr (std::is_same_v<Value, Eigen::Quaterniond>) {
    return QuaternionFault(value, info.limit);
  } else if constexpr (std::is_same_v<Value, double>) {
    return Fault(info, sensor, Eigen::Matrix<double, 1, 1>(value));
  } else if constexpr (std::is_same_v<Value, std::optional<double>>) {
    return value ? Fault(info, sensor, *value) : "";
  } else if constexpr (std::is_same_v<Value, OptionalVector>) {
    if (value.size() == 0) return "";
    const std::string fault =
        CountFault(info, sensor, static_cast<int>(value.size()));
    return fault.empty() ? SizeFault(value, info.limit) : fault;
  } else {
    if (info.accepted == Accepted::kPositive) {
      return PositiveFault(value, info.limit);
    }
    if (info.accepted == Accepted::kLength) {
      return VectorFault(value, info.limit, info.unit);
    }
    return SizeFault(value, info.limit);
  }
}

template <class Imu>
void CheckImu(const Imu& imu, const std::string& path, ViolationList* list) {
  VisitWithSlopes(
      [&](const BlockInfo& info, const auto& value) {
        AddIf(path + "." + std::string(info.field),
              Fault(info, imu, value),
              list);
      },
      imu);
}

void CheckCamera(const CameraCalibration& camera,
                 const std::string& path,
                 ViolationList* list) {
  VisitWithSlopes(
      [&](const BlockInfo& info, const auto& value) {
        AddIf(path + "." + std::string(info.field),
              info.accepted == Accepted::kCoefficients
                  ? DistortionFault(camera)
                  : Fault(info, camera, value),
              list);
      },
      camera);
  AddIf(path + ".width_px", ImageSizeFault(camera.width_px), list);
  AddIf(path + ".height_px", ImageSizeFault(camera.height_px), list);
}

}  // namespace

std::vector<Violation> Validate(const Calibration& theta,
                                const std::string& prefix) {
  // kMaxCameras cameras cannot produce more violations.
  ViolationList list(
      static_cast<int>(2 * (std::size(kImuBlocks) + std::size(kImuSlopes)) +
                       std::size(kMountBlocks) + 1) +
      static_cast<int>(std::size(kCameraBlocks) + std::size(kCameraSlopes) +
                       3) *
          kMaxCameras);
  const std::string begin = prefix.empty() ? "" : prefix + ".";
  CheckImu(theta.imu, begin + "imu", &list);
  if (theta.imu1) CheckImu(*theta.imu1, begin + "imu1", &list);
  const double reference_c = theta.reference_temperature_c;
  const SegmentLimits limits;
  if (!(reference_c >= limits.min_temperature_c &&
        reference_c <= limits.max_temperature_c)) {
    list.Add(begin + "reference_temperature_c",
             Readable(reference_c) +
                 " is not the temperature of a device in degrees Celsius");
  }
  const std::string cameras = begin + "cameras";
  const std::size_t count = theta.cameras.size();
  if (count == 0) {
    list.Add(cameras, "is empty; at least one camera is needed");
  } else if (count > static_cast<std::size_t>(kMaxCameras)) {
    list.Add(cameras, TooMany(count, kMaxCameras));
    return list.Take();
  }
  for (std::size_t j = 0; j < count; ++j) {
    CheckCamera(theta.cameras[j], ElementPath(cameras, j, ""), &list);
  }
  return list.Take();
}

}  // namespace selfcal
