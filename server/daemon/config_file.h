// The TOML file of settings: flat, with the names of the flags as keys.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "server/daemon/options.h"

namespace selfcal::server {

// Applies the settings of the file to *options. INVALID_ARGUMENT with file,
// line and column of the first error: invalid TOML, an unknown setting, or a
// value that the setting does not accept. An empty string or list keeps the
// default.
absl::Status ApplyConfigFile(const std::string& path, DaemonOptions* options);

}  // namespace selfcal::server
