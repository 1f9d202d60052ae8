// The parameter blocks of theta, each declared once, in the order of the
// tangent. Offsets, box-plus and box-minus, names, validation, groups,
// tolerances, conversion to messages, and wording follow from this list.
// Internal to the project: not an installed header.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "core/model/calibration.h"

namespace selfcal {

// Values that are accepted, with a limit far beyond any real device.
enum class Accepted {
  kPositive,      // each positive and at most the limit
  kMagnitude,     // each of a magnitude of at most the limit
  kLength,        // a vector of at most this length
  kUnit,          // a unit quaternion; the limit is the tolerance of its norm
  kCoefficients,  // what the camera's model accepts
};

// When data began to have a block: data from before gets its default. All later
// blocks are kNames: since then, records name their components.
enum class StoredSince { kBegin, kTimeOffset, kNames };

// Standard deviations by grade of IMU (imu_grades.h).
struct GradeTolerance {
  double consumer = 0;
  double factory_calibrated = 0;
};

struct BlockInfo {
  // "gyro.scale": its components are imu.gyro.scale.x, .y, .z. Components of a
  // distortion have the names of the model's coefficients, a scalar has none.
  std::string_view name;
  // Name of the value, and in lower case of the field of the contract.
  std::string_view field;
  std::string_view unit;
  // See TangentComponent. In pixels: for images of kReferenceWidth_px, since in
  // a finer image the same errors of the same scene are more pixels. Ignored
  // for a distortion.
  double sigma_ref = 0;
  // Standard deviation of a value of which a rig states nothing, in pixels for
  // the same images; 0: ten times sigma_ref.
  double prior_sigma = 0;
  Accepted accepted = Accepted::kMagnitude;
  double limit = 0;
  // That of a camera's block; an IMU's is in the group with the IMU's name.
  std::string_view group = {};
  std::string_view words;  // before the name of a component, for people
  GradeTolerance tolerance = {};
  // If false, it is held constant unless the rig estimates it (BlockSetting).
  bool estimated = true;
  // The numbers of components that an optional vector may have, the first of
  // which it gets where it is added (see OptionalSizes).
  std::array<int, 2> sizes = {};
  StoredSince since = StoredSince::kNames;
};

inline constexpr int kReferenceWidth_px = 640;

// In BlockInfo::sizes: one component for each coefficient of the distortion.
// Its sigmas are in units of the reference sigma of the coefficient.
inline constexpr int kAsDistortion = -1;

// The default of the member is that of data from before the block existed. A
// sensor may lack an optional one, which then has no components.
template <class Sensor>
struct Block {
  BlockInfo info;
  std::variant<Eigen::Vector3d Sensor::*,
               Eigen::Vector2d Sensor::*,
               Eigen::Quaterniond Sensor::*,
               DistortionVector Sensor::*,
               double Sensor::*,
               std::optional<double> Sensor::*,
               OptionalVector Sensor::*>
      value;
};

// Sigmas are expected standard deviations after one reference segment:
// statistics of 22 moving segments of a hand-held recording with a FOV camera;
// for the time offset, the median over simulated segments of a hand-held device
// that moves as calmly as in that recording; the line delay is 280 times as
// well determined in such segments.
inline constexpr Block<ImuCalibration> kImuBlocks[] = {
    {{.name = "gyro.scale",
      .field = "s_g",
      .unit = "-",
      .sigma_ref = 6e-3,
      .accepted = Accepted::kPositive,
      .limit = 10,
      .words = "the gyroscope's scale on ",
      .tolerance = {2e-2, 3e-3},
      .since = StoredSince::kBegin},
     &ImuCalibration::s_g},
    {{.name = "gyro.misalignment",
      .field = "m_g",
      .unit = "-",
      .sigma_ref = 7e-3,
      .limit = 10,
      .words = "the gyroscope's misalignment ",
      .tolerance = {2e-2, 2e-3},
      .since = StoredSince::kBegin},
     &ImuCalibration::m_g},
    {{.name = "accel.scale",
      .field = "s_a",
      .unit = "-",
      .sigma_ref = 4e-2,
      .accepted = Accepted::kPositive,
      .limit = 10,
      .words = "the accelerometer's scale on ",
      .tolerance = {2e-2, 3e-3},
      .since = StoredSince::kBegin},
     &ImuCalibration::s_a},
    {{.name = "accel.misalignment",
      .field = "m_a",
      .unit = "-",
      .sigma_ref = 4e-2,
      .limit = 10,
      .words = "the accelerometer's misalignment ",
      .tolerance = {2e-2, 2e-3},
      .since = StoredSince::kBegin},
     &ImuCalibration::m_a},
    {{.name = "q_AI",
      .field = "q_AI",
      .unit = "rad",
      .sigma_ref = 3.5e-2,
      .accepted = Accepted::kUnit,
      .limit = 1e-6,
      .words =
          "the rotation of the accelerometer relative to the gyroscope about ",
      .tolerance = {2e-2, 2e-3},
      .since = StoredSince::kBegin},
     &ImuCalibration::q_AI},
    {{.name = "gyro.g_sensitivity",
      .field = "gyro_g_sensitivity",
      .unit = "rad s/m",
      .sigma_ref = 1e-4,
      .limit = 0.1,
      .words = "the gyroscope's sensitivity to acceleration on ",
      .estimated = false,
      .sizes = {9}},
     &ImuCalibration::gyro_g_sensitivity},
    {{.name = "accel.position",
      .field = "accel_position",
      .unit = "m",
      .sigma_ref = 1e-2,
      .limit = 10,
      .words = "the accelerometer's position along ",
      .estimated = false,
      .sizes = {9, 3}},
     &ImuCalibration::accel_position},
};

// The pose of a second IMU, and its time offset, in the order of
// kMountTangentSize. The pose has the default prior sigmas, ten reference
// sigmas: 0.05 rad and 0.13 m along each axis; the offset has that of filters
// and drivers that differ, 5 ms.
inline constexpr Block<SecondImuCalibration> kMountBlocks[] = {
    {{.name = "q_JI",
      .field = "q_JI",
      .unit = "rad",
      .sigma_ref = 5e-3,
      .accepted = Accepted::kUnit,
      .limit = 1e-6,
      .words = "the rotation relative to the first IMU about "},
     &SecondImuCalibration::q_JI},
    {{.name = "p_JI",
      .field = "p_JI",
      .unit = "m",
      .sigma_ref = 1.3e-2,
      .accepted = Accepted::kLength,
      .limit = 1e3,
      .words = "the distance from the first IMU along "},
     &SecondImuCalibration::p_JI},
    {{.name = "time_offset",
      .field = "time_offset_s",
      .unit = "s",
      .sigma_ref = 1e-5,
      .prior_sigma = 5e-3,
      .limit = kMaxSecondOffset_s,
      .words = "the delay",
      .estimated = false},
     &SecondImuCalibration::time_offset_s},
};

inline constexpr Block<CameraCalibration> kCameraBlocks[] = {
    {{.name = "q_CI",
      .field = "q_CI",
      .unit = "rad",
      .sigma_ref = 5e-3,
      .accepted = Accepted::kUnit,
      .limit = 1e-6,
      .group = "extrinsics",
      .words = "the rotation relative to the IMU about ",
      .since = StoredSince::kBegin},
     &CameraCalibration::q_CI},
    {{.name = "p_CI",
      .field = "p_CI",
      .unit = "m",
      .sigma_ref = 1.3e-2,
      .accepted = Accepted::kLength,
      .limit = 1e3,
      .group = "extrinsics",
      .words = "the distance from the IMU along ",
      .since = StoredSince::kBegin},
     &CameraCalibration::p_CI},
    {{.name = "focal",
      .field = "f",
      .unit = "px",
      .sigma_ref = 1.5,
      .accepted = Accepted::kPositive,
      .limit = 1e6,
      .group = "camera",
      .words = "the focal length in ",
      .since = StoredSince::kBegin},
     &CameraCalibration::f},
    {{.name = "principal",
      .field = "c",
      .unit = "px",
      .sigma_ref = 1.5,
      .limit = 1e6,
      .group = "camera",
      .words = "the principal point in ",
      .since = StoredSince::kBegin},
     &CameraCalibration::c},
    {{.name = "distortion",
      .field = "distortion",
      .unit = "-",
      .accepted = Accepted::kCoefficients,
      .group = "camera",
      .words = "the distortion ",
      .since = StoredSince::kBegin},
     &CameraCalibration::distortion},
    {{.name = "time_offset",
      .field = "time_offset_s",
      .unit = "s",
      .sigma_ref = 6e-4,
      .limit = 0.5,
      .group = "time",
      .words = "the delay of the images",
      .estimated = false,
      .since = StoredSince::kTimeOffset},
     &CameraCalibration::time_offset_s},
    {{.name = "line_delay",
      .field = "line_delay_s",
      .unit = "s",
      .sigma_ref = 2e-6,
      .prior_sigma = 5e-5,
      .limit = 1e-3,
      .group = "time",
      .words = "the time from one row to the next"},
     &CameraCalibration::line_delay_s},
    {{.name = "time_drift",
      .field = "time_drift",
      .unit = "s/s",
      .sigma_ref = 5e-4,
      .prior_sigma = 1e-4,
      .limit = 1e-2,
      .group = "time",
      .words = "the drift of the clock of the images"},
     &CameraCalibration::time_drift},
};

// A block, of an OptionalVector, that is the slope of another one with
// temperature: its name is that of the other, and kSlopeSuffix.
inline constexpr std::string_view kSlopeSuffix = "_slope";
template <class Sensor>
struct SlopeBlock : Block<Sensor> {
  std::variant<Eigen::Vector3d Sensor::*,
               Eigen::Vector2d Sensor::*,
               Eigen::Quaterniond Sensor::*,
               DistortionVector Sensor::*,
               double Sensor::*>
      of;
};

// Prior sigmas are assumptions: 0.03 % per kelvin of a scale, about 1e-4 of a
// focal length, a hundredth of the reference sigma of a coefficient of the
// distortion, 0.003 degrees between camera and IMU, and a microsecond of the
// time offset. Reference sigmas are those of the blocks, over 20 K.
inline constexpr SlopeBlock<ImuCalibration> kImuSlopes[] = {
    {{{.name = "gyro.scale_slope",
       .field = "s_g_slope",
       .unit = "1/K",
       .sigma_ref = 3e-4,
       .prior_sigma = 3e-4,
       .limit = 0.1,
       .words = "the change of the gyroscope's scale with temperature on ",
       .estimated = false,
       .sizes = {3}},
      &ImuCalibration::s_g_slope},
     &ImuCalibration::s_g},
    {{{.name = "gyro.misalignment_slope",
       .field = "m_g_slope",
       .unit = "1/K",
       .sigma_ref = 3.5e-4,
       .prior_sigma = 1e-4,
       .limit = 0.1,
       .words = "the change of the gyroscope's misalignment with temperature ",
       .estimated = false,
       .sizes = {3}},
      &ImuCalibration::m_g_slope},
     &ImuCalibration::m_g},
    {{{.name = "accel.scale_slope",
       .field = "s_a_slope",
       .unit = "1/K",
       .sigma_ref = 2e-3,
       .prior_sigma = 3e-4,
       .limit = 0.1,
       .words = "the change of the accelerometer's scale with temperature on ",
       .estimated = false,
       .sizes = {3}},
      &ImuCalibration::s_a_slope},
     &ImuCalibration::s_a},
    {{{.name = "accel.misalignment_slope",
       .field = "m_a_slope",
       .unit = "1/K",
       .sigma_ref = 2e-3,
       .prior_sigma = 1e-4,
       .limit = 0.1,
       .words =
           "the change of the accelerometer's misalignment with temperature ",
       .estimated = false,
       .sizes = {3}},
      &ImuCalibration::m_a_slope},
     &ImuCalibration::m_a},
    {{{.name = "q_AI_slope",
       .field = "q_AI_slope",
       .unit = "rad/K",
       .sigma_ref = 1.75e-3,
       .prior_sigma = 1e-4,
       .limit = 0.1,
       .words = "the turn of the accelerometer relative to the gyroscope with "
                "temperature about ",
       .estimated = false,
       .sizes = {3}},
      &ImuCalibration::q_AI_slope},
     &ImuCalibration::q_AI},
};

inline constexpr SlopeBlock<CameraCalibration> kCameraSlopes[] = {
    {{{.name = "q_CI_slope",
       .field = "q_CI_slope",
       .unit = "rad/K",
       .sigma_ref = 2.5e-4,
       .prior_sigma = 5e-5,
       .limit = 0.1,
       .group = "extrinsics",
       .words = "the turn relative to the IMU with temperature about ",
       .estimated = false,
       .sizes = {3}},
      &CameraCalibration::q_CI_slope},
     &CameraCalibration::q_CI},
    {{{.name = "p_CI_slope",
       .field = "p_CI_slope",
       .unit = "m/K",
       .sigma_ref = 6.5e-4,
       .prior_sigma = 1e-5,
       .limit = 0.1,
       .group = "extrinsics",
       .words = "the change of the distance from the IMU with temperature "
                "along ",
       .estimated = false,
       .sizes = {3}},
      &CameraCalibration::p_CI_slope},
     &CameraCalibration::p_CI},
    {{{.name = "focal_slope",
       .field = "f_slope",
       .unit = "px/K",
       .sigma_ref = 0.075,
       .prior_sigma = 0.05,
       .limit = 1e3,
       .group = "camera",
       .words = "the change of the focal length with temperature in ",
       .estimated = false,
       .sizes = {2}},
      &CameraCalibration::f_slope},
     &CameraCalibration::f},
    {{{.name = "principal_slope",
       .field = "c_slope",
       .unit = "px/K",
       .sigma_ref = 0.075,
       .prior_sigma = 0.05,
       .limit = 1e3,
       .group = "camera",
       .words = "the change of the principal point with temperature in ",
       .estimated = false,
       .sizes = {2}},
      &CameraCalibration::c_slope},
     &CameraCalibration::c},
    {{{.name = "distortion_slope",
       .field = "distortion_slope",
       .unit = "1/K",
       .sigma_ref = 0.05,
       .prior_sigma = 0.01,
       .limit = 0.1,
       .group = "camera",
       .words = "the change of the distortion with temperature ",
       .estimated = false,
       .sizes = {kAsDistortion}},
      &CameraCalibration::distortion_slope},
     &CameraCalibration::distortion},
    {{{.name = "time_offset_slope",
       .field = "time_offset_slope",
       .unit = "s/K",
       .sigma_ref = 3e-5,
       .prior_sigma = 1e-6,
       .limit = 1e-3,
       .group = "time",
       .words = "the change of the delay of the images with temperature",
       .estimated = false,
       .sizes = {1}},
      &CameraCalibration::time_offset_slope},
     &CameraCalibration::time_offset_s},
};

// BlockInfo::sizes for the sensor that has the block.
template <class Sensor>
std::array<int, 2> OptionalSizes(const BlockInfo& info, const Sensor& sensor) {
  if constexpr (std::is_same_v<Sensor, CameraCalibration>) {
    if (info.sizes[0] == kAsDistortion) {
      return {static_cast<int>(sensor.distortion.size()), 0};
    }
  }
  return info.sizes;
}

template <class Value>
int TangentDimension(const Value& value) {
  if constexpr (std::is_same_v<Value, double>) {
    return 1;
  } else if constexpr (std::is_same_v<Value, std::optional<double>>) {
    return value ? 1 : 0;
  } else if constexpr (std::is_same_v<Value, Eigen::Quaterniond>) {
    return 3;
  } else {
    return static_cast<int>(value.size());
  }
}

// The sum of the dimensions of the blocks before the one with this value, or of
// all if there is none; a distortion and an optional value have none at compile
// time.
template <class Sensor, std::size_t count, class Member = std::nullptr_t>
consteval int OffsetOf(const Block<Sensor> (&blocks)[count],
                       Member value = nullptr) {
  int offset = 0;
  for (const Block<Sensor>& block : blocks) {
    // Not by std::get_if, whose test of a pointer is not constant under
    // UndefinedBehaviorSanitizer.
    const bool found = std::visit(
        [&]<class Each>(Each member) {
          if constexpr (std::is_same_v<Each, Member>) {
            return member == value;
          } else {
            return false;
          }
        },
        block.value);
    if (found) break;
    offset += std::visit(
        []<class Value>(Value Sensor::*) {
          if constexpr (std::is_same_v<Value, double>) {
            return 1;
          } else if constexpr (std::is_same_v<Value, std::optional<double>> ||
                               std::is_same_v<Value, OptionalVector>) {
            return 0;
          } else if constexpr (std::is_same_v<Value, Eigen::Quaterniond>) {
            return 3;
          } else {
            return static_cast<int>(Value::SizeAtCompileTime);
          }
        },
        block.value);
  }
  return offset;
}

static_assert(OffsetOf(kImuBlocks, &ImuCalibration::s_g) == kGyroScale);
static_assert(OffsetOf(kImuBlocks, &ImuCalibration::m_g) == kGyroMisalignment);
static_assert(OffsetOf(kImuBlocks, &ImuCalibration::s_a) == kAccelScale);
static_assert(OffsetOf(kImuBlocks, &ImuCalibration::m_a) == kAccelMisalignment);
static_assert(OffsetOf(kImuBlocks, &ImuCalibration::q_AI) == kAccelRotation);
static_assert(OffsetOf(kImuBlocks) == kImuTangentSize);
static_assert(OffsetOf(kMountBlocks) == kMountTangentSize);
static_assert(OffsetOf(kCameraBlocks, &CameraCalibration::q_CI) ==
              kCameraRotation);
static_assert(OffsetOf(kCameraBlocks, &CameraCalibration::p_CI) ==
              kCameraPosition);
static_assert(OffsetOf(kCameraBlocks, &CameraCalibration::f) ==
              kCameraIntrinsics);
static_assert(OffsetOf(kCameraBlocks, &CameraCalibration::distortion) ==
              kCameraDistortion);

inline constexpr int kFirstImu = -1;
inline constexpr int kSecondImu = -2;

struct BlockPlace {
  const BlockInfo& info;
  int offset;  // in the tangent of theta
  int camera;  // negative: kFirstImu or kSecondImu

  // "imu", "imu1" or "cam0"
  std::string Sensor() const {
    if (camera == kFirstImu) return "imu";
    return camera == kSecondImu ? "imu1" : "cam" + std::to_string(camera);
  }
  // "imu.gyro.scale"
  std::string Name() const { return Sensor() + "." + std::string(info.name); }
};

// Calls visit(info, value, values...) for each block of a sensor, also for
// those that it lacks, with the values of this sensor and of others.
template <class Sensor, class Blocks, class Visitor, class... Sensors>
void VisitSensorBlocks(const Blocks& blocks,
                       const Visitor& visit,
                       Sensor& sensor,
                       Sensors&... sensors) {
  for (const auto& block : blocks) {
    std::visit(
        [&](auto member) {
          visit(block.info, sensor.*member, (sensors.*member)...);
        },
        block.value);
  }
}

// The same for all blocks of an IMU, with its pose if it is the second one, or
// of a camera, and the slopes of those.
template <class Visitor, class Sensor, class... Sensors>
void VisitWithSlopes(const Visitor& visit, Sensor& sensor, Sensors&... others) {
  using Plain = std::remove_const_t<Sensor>;
  if constexpr (std::is_base_of_v<ImuCalibration, Plain>) {
    VisitSensorBlocks(kImuBlocks, visit, sensor, others...);
    if constexpr (std::is_same_v<Plain, SecondImuCalibration>) {
      VisitSensorBlocks(kMountBlocks, visit, sensor, others...);
    }
    VisitSensorBlocks(kImuSlopes, visit, sensor, others...);
  } else {
    VisitSensorBlocks(kCameraBlocks, visit, sensor, others...);
    VisitSensorBlocks(kCameraSlopes, visit, sensor, others...);
  }
}

// Calls visit(place, value, values...) for each block that theta has, with its
// values in theta and in others of the same shape.
template <class Visitor, class Theta, class... Thetas>
void VisitBlocks(const Visitor& visit, Theta& theta, Thetas&... others) {
  int offset = 0;
  int camera = kFirstImu;
  const auto visit_block =
      [&](const BlockInfo& info, auto& value, auto&... values) {
        if (TangentDimension(value) == 0) return;
        visit(BlockPlace{info, offset, camera}, value, values...);
        offset += TangentDimension(value);
      };
  const auto visit_all = [&](const auto& of_imu,
                             const auto& of_mount,
                             const auto& of_cameras) {
    camera = kFirstImu;
    VisitSensorBlocks(of_imu, visit_block, theta.imu, others.imu...);
    if (theta.imu1) {
      camera = kSecondImu;
      VisitSensorBlocks(of_imu, visit_block, *theta.imu1, *others.imu1...);
      VisitSensorBlocks(of_mount, visit_block, *theta.imu1, *others.imu1...);
    }
    for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
      camera = static_cast<int>(j);
      VisitSensorBlocks(
          of_cameras, visit_block, theta.cameras[j], others.cameras[j]...);
    }
  };
  constexpr std::array<Block<SecondImuCalibration>, 0> kNone = {};
  visit_all(kImuBlocks, kMountBlocks, kCameraBlocks);
  visit_all(kImuSlopes, kNone, kCameraSlopes);
}

// The name of the block of each component, in the order of the tangent.
std::vector<std::string> ComponentBlocks(const Calibration& theta);

}  // namespace selfcal
