#include "client/c/calibration.h"

#include <absl/status/statusor.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "client/c/block_values.h"
#include "client/c/boundary.h"
#include "core/model/camera.h"
#include "core/model/camera_model.h"
#include "core/model/imu.h"
#include "core/model/rig.h"
#include "core/model/temperature.h"

namespace selfcal::c {

std::shared_ptr<const PublishedVersion> Publish(
    const client::CalibrationVersion& version) {
  return std::make_shared<const PublishedVersion>(
      PublishedVersion{version,
                       TangentComponents(version.theta),
                       ReadableValues(version.theta)});
}

namespace {

// The calibration behind a handle that is not null.
const Calibration& ThetaOf(const selfcal_calibration* calibration) {
  return calibration->published->version.theta;
}

// OUT_OF_RANGE for an index that is not below the count.
absl::Status CheckIndex(std::int32_t index,
                        std::size_t count,
                        const char* name) {
  if (index >= 0 && static_cast<std::size_t>(index) < count) {
    return absl::OkStatus();
  }
  return absl::OutOfRangeError(
      fmt::format("{}: is {}, there are {}", name, index, count));
}

// Checks the handle and the index of a camera.
absl::Status CheckCamera(const selfcal_calibration* calibration,
                         std::int32_t index) {
  if (auto s = RequireNotNull(calibration, "calibration"); !s.ok()) return s;
  return CheckIndex(index, ThetaOf(calibration).cameras.size(), "camera");
}

absl::Status CheckAllNotNull(
    std::initializer_list<std::pair<const void*, const char*>> arguments) {
  for (const auto& [pointer, name] : arguments) {
    if (auto s = RequireNotNull(pointer, name); !s.ok()) return s;
  }
  return absl::OkStatus();
}

template <typename Vector>
void Copy(const Vector& from, double* to) {
  std::copy_n(from.data(), from.size(), to);
}

selfcal_quaternion ToQuaternion(const Eigen::Quaterniond& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

selfcal_imu ToImu(const ImuCalibration& given) {
  selfcal_imu imu = {};
  Copy(given.s_g, imu.gyro_scale);
  Copy(given.m_g, imu.gyro_misalignment);
  Copy(given.s_a, imu.accel_scale);
  Copy(given.m_a, imu.accel_misalignment);
  imu.q_AI = ToQuaternion(given.q_AI);
  imu.gyro_g_sensitivity_size =
      static_cast<std::int32_t>(given.gyro_g_sensitivity.size());
  imu.accel_position_size =
      static_cast<std::int32_t>(given.accel_position.size());
  Copy(given.gyro_g_sensitivity, imu.gyro_g_sensitivity);
  Copy(given.accel_position, imu.accel_position);
  return imu;
}

static_assert(kMaxDistortion <= SELFCAL_MAX_DISTORTION);

selfcal_camera ToCamera(const CameraCalibration& given) {
  selfcal_camera camera = {};
  camera.width_px = given.width_px;
  camera.height_px = given.height_px;
  camera.distortion_size = static_cast<std::int32_t>(given.distortion.size());
  camera.model = DistortionName(given.model).data();  // of a literal
  Copy(given.distortion, camera.distortion);
  Copy(given.f, camera.f);
  Copy(given.c, camera.c);
  camera.q_CI = ToQuaternion(given.q_CI);
  Copy(given.p_CI, camera.p_CI);
  camera.time_offset_s = given.time_offset_s;
  camera.rolling_shutter = given.line_delay_s.has_value();
  camera.line_delay_s = given.line_delay_s.value_or(0);
  camera.clock_drifts = given.time_drift.has_value();
  camera.time_drift = given.time_drift.value_or(0);
  return camera;
}

Eigen::Quaterniond FromQuaternion(const selfcal_quaternion& q) {
  return {q.w, q.x, q.y, q.z};
}

// Reads an optional block; INVALID_ARGUMENT for a size that does not fit.
// Validate() checks the others.
absl::Status FromOptional(const std::string& name,
                          std::int32_t size,
                          const double (&values)[kMaxOptionalSize],
                          OptionalVector* block) {
  if (size < 0 || size > kMaxOptionalSize) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: is {}, must be 0 to {}", name, size, kMaxOptionalSize));
  }
  *block = Eigen::Map<const Eigen::VectorXd>(values, size);
  return absl::OkStatus();
}

// INVALID_ARGUMENT for a struct of the wrong size.
absl::Status FromImu(const selfcal_imu* given, ImuCalibration* imu) {
  selfcal_imu read;
  auto status = Read(given, kImuSize, "imu", &read);
  if (!status.ok()) return status;
  imu->s_g = Eigen::Vector3d(read.gyro_scale);
  imu->m_g = Eigen::Vector3d(read.gyro_misalignment);
  imu->s_a = Eigen::Vector3d(read.accel_scale);
  imu->m_a = Eigen::Vector3d(read.accel_misalignment);
  imu->q_AI = FromQuaternion(read.q_AI);
  status = FromOptional("imu.gyro_g_sensitivity_size",
                        read.gyro_g_sensitivity_size,
                        read.gyro_g_sensitivity,
                        &imu->gyro_g_sensitivity);
  if (!status.ok()) return status;
  return FromOptional("imu.accel_position_size",
                      read.accel_position_size,
                      read.accel_position,
                      &imu->accel_position);
}

// INVALID_ARGUMENT for a struct of the wrong size, and for a model that is not
// known or has another number of coefficients.
absl::Status FromCamera(const selfcal_camera* given,
                        const std::string& name,
                        CameraCalibration* camera) {
  selfcal_camera read;
  auto status = Read(given, kCameraSize, name.c_str(), &read);
  if (!status.ok()) return status;
  const std::string model = read.model == nullptr ? "" : read.model;
  const auto models = DistortionModels();
  const auto found = std::find_if(
      models.begin(), models.end(), [&](DistortionModel candidate) {
        return DistortionName(candidate) == model;
      });
  if (found == models.end()) {
    return absl::InvalidArgumentError(
        fmt::format("{}.model: '{}' is not known", name, model));
  }
  if (read.distortion_size != DistortionSize(*found)) {
    return absl::InvalidArgumentError(
        fmt::format("{}.distortion_size: is {}, the model {} has {}",
                    name,
                    read.distortion_size,
                    model,
                    DistortionSize(*found)));
  }
  camera->model = *found;
  camera->distortion =
      Eigen::Map<Eigen::VectorXd>(read.distortion, read.distortion_size);
  camera->f = Eigen::Vector2d(read.f);
  camera->c = Eigen::Vector2d(read.c);
  camera->q_CI = FromQuaternion(read.q_CI);
  camera->p_CI = Eigen::Vector3d(read.p_CI);
  camera->time_offset_s = read.time_offset_s;
  if (read.rolling_shutter != 0) camera->line_delay_s = read.line_delay_s;
  if (read.clock_drifts != 0) camera->time_drift = read.time_drift;
  camera->width_px = read.width_px;
  camera->height_px = read.height_px;
  return status;
}

// INVALID_ARGUMENT names a value that is not valid.
absl::Status CheckValid(const Calibration& theta) {
  const auto violations = Validate(theta, "calibration");
  if (violations.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "{}: {}", violations.front().field, violations.front().message));
}

// A handle of values that no daemon has published.
selfcal_calibration* Unpublished(Calibration theta) {
  client::CalibrationVersion version;
  version.theta = std::move(theta);
  return new selfcal_calibration{Publish(version)};
}

absl::StatusOr<Calibration> ToCalibration(const selfcal_imu* imu,
                                          const selfcal_camera* const* cameras,
                                          std::int32_t count) {
  if (count < 0 || count > kMaxCameras) {
    return absl::InvalidArgumentError(
        fmt::format("count: is {}, must be from 0 to {}", count, kMaxCameras));
  }
  Calibration theta;
  auto status = FromImu(imu, &theta.imu);
  if (status.ok() && count > 0) status = RequireNotNull(cameras, "cameras");
  theta.cameras.resize(static_cast<std::size_t>(count));
  for (std::size_t j = 0; status.ok() && j < theta.cameras.size(); ++j) {
    status = FromCamera(
        cameras[j], fmt::format("cameras[{}]", j), &theta.cameras[j]);
  }
  if (status.ok()) status = CheckValid(theta);
  if (!status.ok()) return status;
  return theta;
}

std::int32_t ToVerdict(client::CalibrationVersion::Verdict verdict) {
  using Verdict = client::CalibrationVersion::Verdict;
  switch (verdict) {
    case Verdict::kGood:
      return SELFCAL_VERDICT_GOOD;
    case Verdict::kWeak:
      return SELFCAL_VERDICT_WEAK;
    case Verdict::kNotTrustworthy:
      return SELFCAL_VERDICT_NOT_TRUSTWORTHY;
    case Verdict::kFactory:
      return SELFCAL_VERDICT_FACTORY;
    case Verdict::kUnknown:
      break;
  }
  return SELFCAL_VERDICT_UNKNOWN;
}

selfcal_component ToComponent(const PublishedVersion& published,
                              std::int32_t index) {
  const TangentComponent& given =
      published.components[static_cast<std::size_t>(index)];
  const Eigen::MatrixXd& covariance = published.version.covariance;
  selfcal_component component = {};
  component.name = given.name.c_str();
  component.unit = given.unit.c_str();
  component.value = published.values[index];
  component.sigma = covariance.size() == 0
                        ? std::numeric_limits<double>::quiet_NaN()
                        : std::sqrt(covariance(index, index));
  return component;
}

}  // namespace
}  // namespace selfcal::c

using selfcal::c::Guarded;
using selfcal::c::RequireNotNull;

int32_t selfcal_calibration_create(const selfcal_imu* imu,
                                   const selfcal_camera* const* cameras,
                                   int32_t count,
                                   selfcal_calibration** calibration,
                                   selfcal_error* error) {
  if (calibration != nullptr) *calibration = nullptr;
  return Guarded(error, [&] {
    const auto theta = selfcal::c::ToCalibration(imu, cameras, count);
    if (!theta.ok()) return theta.status();
    auto status = RequireNotNull(calibration, "calibration");
    if (!status.ok()) return status;
    *calibration = selfcal::c::Unpublished(*theta);
    return status;
  });
}

int32_t selfcal_calibration_with_block(const selfcal_calibration* calibration,
                                       const char* name,
                                       const double* values,
                                       uint64_t size,
                                       selfcal_calibration** with,
                                       selfcal_error* error) {
  if (with != nullptr) *with = nullptr;
  return Guarded(error, [&] {
    auto status = selfcal::c::CheckAllNotNull(
        {{calibration, "calibration"}, {name, "name"}, {with, "with"}});
    if (status.ok() && size > 0) status = RequireNotNull(values, "values");
    if (!status.ok()) return status;
    selfcal::Calibration theta = selfcal::c::ThetaOf(calibration);
    status = selfcal::c::SetBlock(name, {values, size}, &theta);
    if (status.ok()) status = selfcal::c::CheckValid(theta);
    if (!status.ok()) return status;
    *with = selfcal::c::Unpublished(std::move(theta));
    return status;
  });
}

selfcal_calibration* selfcal_calibration_copy(
    const selfcal_calibration* calibration) {
  if (calibration == nullptr) return nullptr;
  return selfcal::c::OrNull(
      [&] { return new selfcal_calibration(*calibration); });
}

int32_t selfcal_calibration_at_temperature(
    const selfcal_calibration* calibration,
    double temperature_c,
    selfcal_calibration** at,
    selfcal_error* error) {
  if (at != nullptr) *at = nullptr;
  return Guarded(error, [&] {
    auto status =
        selfcal::c::CheckAllNotNull({{calibration, "calibration"}, {at, "at"}});
    if (!status.ok()) return status;
    const auto& version = calibration->published->version;
    const std::string fault =
        selfcal::TemperatureFault(version.theta, temperature_c);
    if (!fault.empty()) {
      return absl::InvalidArgumentError("temperature_c: " + fault);
    }
    *at = new selfcal_calibration{
        selfcal::c::Publish(AtTemperature(version, temperature_c))};
    return status;
  });
}

void selfcal_calibration_destroy(selfcal_calibration* calibration) {
  delete calibration;
}

int64_t selfcal_calibration_version(const selfcal_calibration* calibration) {
  return calibration == nullptr ? 0 : calibration->published->version.version;
}

int32_t selfcal_calibration_get_verdict(
    const selfcal_calibration* calibration) {
  return calibration == nullptr
             ? SELFCAL_VERDICT_UNKNOWN
             : selfcal::c::ToVerdict(calibration->published->version.verdict);
}

int32_t selfcal_calibration_reason_count(
    const selfcal_calibration* calibration) {
  return calibration == nullptr
             ? 0
             : static_cast<int32_t>(
                   calibration->published->version.reasons.size());
}

const char* selfcal_calibration_reason(const selfcal_calibration* calibration,
                                       int32_t index) {
  if (index < 0 || index >= selfcal_calibration_reason_count(calibration)) {
    return nullptr;
  }
  const auto at = static_cast<std::size_t>(index);
  return calibration->published->version.reasons[at].c_str();
}

int32_t selfcal_calibration_camera_count(
    const selfcal_calibration* calibration) {
  return calibration == nullptr
             ? 0
             : static_cast<int32_t>(
                   selfcal::c::ThetaOf(calibration).cameras.size());
}

int32_t selfcal_calibration_component_count(
    const selfcal_calibration* calibration) {
  return calibration == nullptr
             ? 0
             : static_cast<int32_t>(calibration->published->components.size());
}

int32_t selfcal_calibration_get_imu(const selfcal_calibration* calibration,
                                    selfcal_imu* imu,
                                    selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = RequireNotNull(calibration, "calibration");
    if (!status.ok()) return status;
    return selfcal::c::Write(
        selfcal::c::ToImu(selfcal::c::ThetaOf(calibration).imu),
        selfcal::c::kImuSize,
        "imu",
        imu);
  });
}

int32_t selfcal_calibration_get_camera(const selfcal_calibration* calibration,
                                       int32_t index,
                                       selfcal_camera* camera,
                                       selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = selfcal::c::CheckCamera(calibration, index);
    if (!status.ok()) return status;
    const auto at = static_cast<std::size_t>(index);
    return selfcal::c::Write(
        selfcal::c::ToCamera(selfcal::c::ThetaOf(calibration).cameras[at]),
        selfcal::c::kCameraSize,
        "camera",
        camera);
  });
}

int32_t selfcal_calibration_get_component(
    const selfcal_calibration* calibration,
    int32_t index,
    selfcal_component* component,
    selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = RequireNotNull(calibration, "calibration");
    if (!status.ok()) return status;
    const auto& published = *calibration->published;
    status =
        selfcal::c::CheckIndex(index, published.components.size(), "component");
    if (!status.ok()) return status;
    return selfcal::c::Write(selfcal::c::ToComponent(published, index),
                             selfcal::c::kComponentSize,
                             "component",
                             component);
  });
}

int32_t selfcal_calibration_get_covariance(
    const selfcal_calibration* calibration,
    double* covariance,
    uint64_t size,
    selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = selfcal::c::CheckAllNotNull(
        {{calibration, "calibration"}, {covariance, "covariance"}});
    if (!status.ok()) return status;
    const auto& published = *calibration->published;
    const std::uint64_t count = published.components.size();
    if (size != count * count) {
      return absl::InvalidArgumentError(
          fmt::format("size: is {}, must be {} x {}", size, count, count));
    }
    if (published.version.covariance.size() == 0) {
      return absl::FailedPreconditionError(fmt::format(
          "version {} has no covariance", published.version.version));
    }
    // Symmetric: rows and columns are the same.
    selfcal::c::Copy(published.version.covariance, covariance);
    return absl::OkStatus();
  });
}

int32_t selfcal_calibration_correct_imu(const selfcal_calibration* calibration,
                                        const double gyro[3],
                                        const double accel[3],
                                        const double b_g[3],
                                        const double b_a[3],
                                        double w_I[3],
                                        double f_I[3],
                                        selfcal_error* error) {
  constexpr double kConstantRate[3] = {0, 0, 0};
  return selfcal_calibration_correct_imu_dw(
      calibration, gyro, accel, b_g, b_a, kConstantRate, w_I, f_I, error);
}

int32_t selfcal_calibration_correct_imu_dw(
    const selfcal_calibration* calibration,
    const double gyro[3],
    const double accel[3],
    const double b_g[3],
    const double b_a[3],
    const double dw_I[3],
    double w_I[3],
    double f_I[3],
    selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = selfcal::c::CheckAllNotNull({{calibration, "calibration"},
                                               {gyro, "gyro"},
                                               {accel, "accel"},
                                               {b_g, "b_g"},
                                               {b_a, "b_a"},
                                               {dw_I, "dw_I"},
                                               {w_I, "w_I"},
                                               {f_I, "f_I"}});
    if (!status.ok()) return status;
    const selfcal::BodyRates rates =
        selfcal::CorrectImu(selfcal::c::ThetaOf(calibration).imu,
                            Eigen::Vector3d(gyro),
                            Eigen::Vector3d(accel),
                            Eigen::Vector3d(b_g),
                            Eigen::Vector3d(b_a),
                            Eigen::Vector3d(dw_I));
    selfcal::c::Copy(rates.w_I, w_I);
    selfcal::c::Copy(rates.f_I, f_I);
    return absl::OkStatus();
  });
}

int32_t selfcal_calibration_carry_biases(const selfcal_calibration* from,
                                         const selfcal_calibration* to,
                                         const double f_I[3],
                                         double b_g[3],
                                         double b_a[3],
                                         selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = selfcal::c::CheckAllNotNull(
        {{from, "from"}, {to, "to"}, {f_I, "f_I"}, {b_g, "b_g"}, {b_a, "b_a"}});
    if (!status.ok()) return status;
    const selfcal::ImuBiases carried =
        selfcal::CarryBiases(selfcal::c::ThetaOf(from).imu,
                             selfcal::c::ThetaOf(to).imu,
                             Eigen::Vector3d(f_I),
                             {Eigen::Vector3d(b_g), Eigen::Vector3d(b_a)});
    selfcal::c::Copy(carried.b_g, b_g);
    selfcal::c::Copy(carried.b_a, b_a);
    return absl::OkStatus();
  });
}

int32_t selfcal_calibration_project(const selfcal_calibration* calibration,
                                    int32_t camera,
                                    const double p_C[3],
                                    double z_px[2],
                                    selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = selfcal::c::CheckCamera(calibration, camera);
    if (!status.ok()) return status;
    status = selfcal::c::CheckAllNotNull({{p_C, "p_C"}, {z_px, "z_px"}});
    if (!status.ok()) return status;
    const auto at = static_cast<std::size_t>(camera);
    Eigen::Vector2d projected;
    if (!selfcal::Project(selfcal::c::ThetaOf(calibration).cameras[at],
                          Eigen::Vector3d(p_C),
                          &projected,
                          nullptr)) {
      return absl::OutOfRangeError("p_C: the model does not project it");
    }
    selfcal::c::Copy(projected, z_px);
    return absl::OkStatus();
  });
}

int32_t selfcal_calibration_unproject(const selfcal_calibration* calibration,
                                      int32_t camera,
                                      const double z_px[2],
                                      double bearing_C[3],
                                      selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = selfcal::c::CheckCamera(calibration, camera);
    if (!status.ok()) return status;
    status =
        selfcal::c::CheckAllNotNull({{z_px, "z_px"}, {bearing_C, "bearing_C"}});
    if (!status.ok()) return status;
    const auto at = static_cast<std::size_t>(camera);
    Eigen::Vector3d bearing;
    if (!selfcal::Unproject(selfcal::c::ThetaOf(calibration).cameras[at],
                            Eigen::Vector2d(z_px),
                            &bearing)) {
      return absl::OutOfRangeError("z_px: no point projects to it");
    }
    selfcal::c::Copy(bearing, bearing_C);
    return absl::OkStatus();
  });
}
