// What selfcald is told at its start: flags, or a TOML file of the same names.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/change/detect_change.h"
#include "server/host/host_conditions.h"

namespace selfcal::server {

struct DaemonOptions {
  std::filesystem::path state_dir;
  std::vector<std::string> listen;  // "unix:/path" or "host:port"
  int scoring_threads = 1;
  SolverKind solver = SolverKind::kStructured;
  ChangeOptions change;
  HostLimits host;  // for runs that nobody asks for
  bool idle_runs = true;
  double max_run_minutes = 30;  // of a run; it fails then
  std::string log_level = "info";
};

// Fills *options. Returns the exit code if the program ends here: 0 after
// --help and --version, 2 after a mistake, which is explained on stderr.
std::optional<int> ParseOptions(int argc, char** argv, DaemonOptions* options);

}  // namespace selfcal::server
