// Connects the store, the pipeline, the metrics and the gRPC server, and runs
// them until a signal to stop.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "server/daemon/options.h"

namespace selfcal::server {

// Checks the settings and the files that they name. Returns 0, or 1 with an
// explanation in the log.
int Check(const DaemonOptions& options);

// Runs the daemon; returns the exit code. At SIGHUP it sets the log level that
// `read_log_level` returns; that is nullopt if the settings have an error,
// which it explains.
int Serve(const DaemonOptions& options,
          const std::function<std::optional<std::string>()>& read_log_level);

}  // namespace selfcal::server
