// Recordings in the format of EuRoC (Burri et al. 2016), which TUM-VI shares:
//
//   mav0/camN/data.csv, mav0/camN/data/STAMP.png, mav0/camN/sensor.yaml
//   mav0/imu0/data.csv, mav0/imu0/sensor.yaml
//   mav0/imu1/data.csv, ...   of a second IMU, if there is one
//
// A sensor.yaml may be missing.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "client/recording/recording.h"

namespace selfcal::client {

// True for a folder that contains mav0, or is it.
bool IsEurocFolder(const std::string& path);

absl::StatusOr<std::unique_ptr<Recording>> OpenEurocFolder(
    const std::string& folder);

}  // namespace selfcal::client
