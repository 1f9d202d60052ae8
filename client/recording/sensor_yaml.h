// The sensor.yaml of a camera, or of the IMU, in a folder of EuRoC's format.
//
// Pure functions, callable from any thread.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "core/model/camera.h"
#include "core/model/rig.h"

namespace selfcal::client {

// Parses the text: T_BS takes a point from the camera to the body B, which
// takes the place of I in the result. `time_offset_s`, which is not part of the
// format, is read where it is stated. The camera model is a pinhole with
// distortion_model "radial-tangential", "equidistant", ..., as selfcal calls
// its models. INVALID_ARGUMENT with the key for text that is not this.
absl::StatusOr<CameraCalibration> ParseCameraYaml(const std::string& text);

struct ImuYaml {
  // T_BI: takes a point from the IMU to the body.
  Eigen::Isometry3d T_BI = Eigen::Isometry3d::Identity();
  // Unless all four densities are stated, none is.
  std::optional<ImuNoise> noise;
};

// The same for the IMU. Without T_BS, it is the body.
absl::StatusOr<ImuYaml> ParseImuYaml(const std::string& text);

}  // namespace selfcal::client
