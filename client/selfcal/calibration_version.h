// Conversion of the message that publishes a calibration into the value that a
// SLAM process uses.
#pragma once

#include <absl/status/statusor.h>

#include "client/selfcal/client.h"
#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

// Returns DATA_LOSS, with the path of the field, if the message is not a valid
// calibration or its covariance has the wrong size.
absl::StatusOr<CalibrationVersion> ToCalibrationVersion(
    const v1::Calibration& message);

}  // namespace selfcal::client
