// Parsers of the filter and the order of a list of versions
// (ListCalibrationsRequest in selfcal/v1/calibration_service.proto has the
// grammar).
#pragma once

#include <absl/status/status.h>

#include <string_view>

#include "server/store/calibration_query.h"

namespace selfcal::server {

// INVALID_ARGUMENT names the position and what was expected.
absl::Status ParseCalibrationFilter(std::string_view filter,
                                    CalibrationQuery* query);
absl::Status ParseCalibrationOrder(std::string_view order_by,
                                   CalibrationQuery* query);

}  // namespace selfcal::server
