// What selfcald is told at its start. Each setting has one name: the flag
// --name, the variable SELFCAL_NAME (capitals, '_' for '-') and the key in the
// TOML file. A flag goes before the environment, the environment before the
// file, the file before the default.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/calibration/calibrate.h"
#include "core/verify/scorer.h"
#include "server/domain/domain_options.h"
#include "server/host/host_conditions.h"
#include "server/service/server.h"

namespace selfcal::server {

struct DaemonOptions {
  // Not given: the service manager's STATE_DIRECTORY.
  std::filesystem::path state_dir;
  // Without an address to listen on: selfcald.sock in the service manager's
  // RUNTIME_DIRECTORY, or else in the state folder.
  ServerOptions server;
  int scoring_threads = 1;
  int max_backlog = 64;  // stored and unscored segments; then streams wait
  SolverKind solver = SolverKind::kStructured;
  ScorerKind scorer = ScorerKind::kStructured;
  // Of scores and calibrations: computed by the other core as well.
  double verify_share = 0;
  DomainOptions domain;
  HostLimits host;  // for runs that nobody asks for
  bool idle_runs = true;
  double max_run_minutes = 30;      // of a run; it fails then
  int max_run_memory_mib = 512;     // of a run; 0: no limit
  double session_idle_s = 60;       // then a session has ended; 0: never
  std::string metrics = "off";      // or host:port of the loopback
  int metrics_rigs = 16;            // with series of their own
  std::string console = "off";      // or host:port
  Role console_role = Role::kRead;  // of whoever opens it on the loopback
  std::string log_level = "info";
  std::string log_format = "text";
  bool check = false;  // no setting: look at the settings and end

  friend bool operator==(const DaemonOptions&, const DaemonOptions&) = default;
};

// Fills *options. Returns the exit code if the program ends here: 0 after
// --help and --version, 2 after a mistake, which is explained on stderr; one in
// the file with its line.
std::optional<int> ParseOptions(int argc, char** argv, DaemonOptions* options);

}  // namespace selfcal::server
