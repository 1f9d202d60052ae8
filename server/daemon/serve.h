// Wires the store, the pipeline, the metrics and the gRPC server, and runs them
// until a signal tells to stop.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "server/daemon/options.h"

namespace selfcal::server {

// Looks at what the settings name: 0, or 1 with an explanation in the log.
int Check(const DaemonOptions& options);

// Returns the exit code. SIGHUP takes up the log level that `read_log_level`
// returns; nothing if the settings have a mistake, which it explains.
int Serve(const DaemonOptions& options,
          const std::function<std::optional<std::string>()>& read_log_level);

}  // namespace selfcal::server
