// The name of an IMU on the command line.
#pragma once

#include <absl/status/status.h>

#include <string>

namespace selfcal::client {

// INVALID_ARGUMENT that lists the parts, and names the one that is most likely
// meant. `prefix` begins the message.
absl::Status UnknownImuPreset(const std::string& prefix,
                              const std::string& name);

}  // namespace selfcal::client
