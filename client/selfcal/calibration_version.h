// From the message that publishes a calibration to the value a SLAM process
// uses.
#pragma once

#include <absl/status/statusor.h>

#include "client/selfcal/client.h"
#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

// DATA_LOSS, with the path of the field, for a message that is no calibration
// or whose covariance has the wrong size.
absl::StatusOr<CalibrationVersion> ToCalibrationVersion(
    const v1::Calibration& message);

}  // namespace selfcal::client
