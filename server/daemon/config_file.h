// The TOML file of settings: flat, with the names of the flags.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "server/daemon/options.h"

namespace selfcal::server {

// Writes what the file sets to *options. INVALID_ARGUMENT with file, line and
// column for the first mistake: no TOML, a name that is no setting, a value
// that the setting does not take. An empty text or list leaves the default.
absl::Status ApplyConfigFile(const std::string& path, DaemonOptions* options);

}  // namespace selfcal::server
