// The values of any parameter block, by its name: what the structs of the C
// interface have no member for.
#pragma once

#include <absl/status/status.h>

#include <span>
#include <string>

#include "core/model/calibration.h"

namespace selfcal::c {

// Sets a block, "imu.gyro.g_sensitivity" or "cam0.focal_slope", to its values
// in the order of its components, a rotation to (w, x, y, z); no values remove
// an optional block. INVALID_ARGUMENT for a block that is not known, and for
// another number of values than it has. Validate() checks the values.
absl::Status SetBlock(const std::string& name,
                      std::span<const double> values,
                      Calibration* theta);

}  // namespace selfcal::c
