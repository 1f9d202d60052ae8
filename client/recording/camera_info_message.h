// The calibration that a sensor_msgs/CameraInfo states.
#pragma once

#include <absl/status/statusor.h>

#include "client/recording/ros_messages.h"
#include "core/model/camera.h"

namespace selfcal::client {

// A camera without a pose, as a camera_info file with the same content is read
// (client/formats/camera_info.h). INVALID_ARGUMENT with the reason for a camera
// that is not calibrated, whose model is not known, or whose images are a part
// of the sensor or binned.
absl::StatusOr<CameraCalibration> CalibrationOf(const RosCameraInfo& info);

}  // namespace selfcal::client
