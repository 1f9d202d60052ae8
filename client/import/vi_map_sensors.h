// The calibration in a VI-map's sensors.yaml.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "core/model/rig.h"

namespace selfcal::client {

// A rig (id empty) from the text of sensors.yaml: the first IMU and the first
// camera system. `path` is named in errors. IMU intrinsics are nominal, which
// is what maplab assumes.
absl::StatusOr<Rig> ParseSensors(const std::string& text,
                                 const std::string& path);

}  // namespace selfcal::client
