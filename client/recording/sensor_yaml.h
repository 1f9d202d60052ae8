// The sensor.yaml of a camera in a folder of EuRoC's format.
//
// A pure function, callable from any thread.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "core/model/camera.h"

namespace selfcal::client {

// Parses the text: T_BS takes a point from the camera to the body, which is the
// IMU. The camera model is a pinhole with distortion_model "radial-tangential",
// "equidistant", ..., as selfcal calls its models. INVALID_ARGUMENT with the
// key for text that is not this.
absl::StatusOr<CameraCalibration> ParseCameraYaml(const std::string& text);

}  // namespace selfcal::client
