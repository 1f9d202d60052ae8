// Validation of a calibration; all other modules rely on it.
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "core/model/rig.h"
#include "core/model/violation_list.h"

namespace selfcal {
namespace {

constexpr double kQuaternionTolerance = 1e-6;
// Far beyond any real device; values within these limits do not overflow.
constexpr double kMaxScale = 10;
constexpr double kMaxMisalignment = 10;
constexpr double kMaxPosition_m = 1e3;
constexpr double kMaxFocal_px = 1e6;
constexpr double kMaxPrincipal_px = 1e6;
constexpr double kMaxCoefficient = 1e3;
constexpr double kMaxTimeOffset_s = 0.5;
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
  if (camera.model != DistortionModel::kFov) {
    return SizeFault(camera.distortion, kMaxCoefficient);
  }
  if (!camera.distortion.allFinite()) return "is not finite";
  if (std::abs(camera.distortion[0]) < std::numbers::pi) return "";
  return "w is " + Readable(camera.distortion[0]) +
         " rad; its magnitude must be below pi";
}

std::string ImageSizeFault(int size_px) {
  if (size_px >= 1 && size_px <= kMaxImageSize_px) return "";
  return std::to_string(size_px) + " is not in [1, " +
         std::to_string(kMaxImageSize_px) + "]";
}

void CheckImu(const ImuCalibration& imu,
              const std::string& path,
              ViolationList* list) {
  AddIf(path + ".s_g", PositiveFault(imu.s_g, kMaxScale), list);
  AddIf(path + ".m_g", SizeFault(imu.m_g, kMaxMisalignment), list);
  AddIf(path + ".s_a", PositiveFault(imu.s_a, kMaxScale), list);
  AddIf(path + ".m_a", SizeFault(imu.m_a, kMaxMisalignment), list);
  AddIf(path + ".q_AI", QuaternionFault(imu.q_AI, kQuaternionTolerance), list);
}

void CheckCamera(const CameraCalibration& camera,
                 const std::string& path,
                 ViolationList* list) {
  AddIf(
      path + ".q_CI", QuaternionFault(camera.q_CI, kQuaternionTolerance), list);
  AddIf(path + ".p_CI", VectorFault(camera.p_CI, kMaxPosition_m, "m"), list);
  AddIf(path + ".f", PositiveFault(camera.f, kMaxFocal_px), list);
  AddIf(path + ".c", SizeFault(camera.c, kMaxPrincipal_px), list);
  AddIf(path + ".distortion", DistortionFault(camera), list);
  AddIf(path + ".time_offset_s",
        SizeFault(Eigen::Matrix<double, 1, 1>(camera.time_offset_s),
                  kMaxTimeOffset_s),
        list);
  AddIf(path + ".width_px", ImageSizeFault(camera.width_px), list);
  AddIf(path + ".height_px", ImageSizeFault(camera.height_px), list);
}

}  // namespace

std::vector<Violation> Validate(const Calibration& theta,
                                const std::string& prefix) {
  // kMaxCameras cameras cannot produce more violations.
  ViolationList list(9 * (kMaxCameras + 1));
  const std::string begin = prefix.empty() ? "" : prefix + ".";
  CheckImu(theta.imu, begin + "imu", &list);
  const std::string cameras = begin + "cameras";
  const std::size_t count = theta.cameras.size();
  if (count == 0) {
    list.Add(cameras, "is empty; at least one camera is needed");
  } else if (count > static_cast<std::size_t>(kMaxCameras)) {
    list.Add(cameras,
             "has " + std::to_string(count) + " elements; at most " +
                 std::to_string(kMaxCameras) + " are allowed");
    return list.Take();
  }
  for (std::size_t j = 0; j < count; ++j) {
    CheckCamera(theta.cameras[j], ElementPath(cameras, j, ""), &list);
  }
  return list.Take();
}

}  // namespace selfcal
