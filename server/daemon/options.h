// The settings of selfcald. Each setting has one name: the flag --name, the
// environment variable SELFCAL_NAME (in capitals, '_' for '-') and the key in
// the TOML file. A flag takes precedence over the environment, the environment
// over the file, the file over the default.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/calibration/calibrate.h"
#include "core/verify/scorer.h"
#include "server/domain/domain_options.h"
#include "server/grpc/server.h"
#include "server/host/host_conditions.h"
#include "server/population/population_options.h"
#include "server/uplink/uplink_options.h"

namespace selfcal::server {

struct DaemonOptions {
  // Default: the service manager's STATE_DIRECTORY.
  std::filesystem::path state_dir;
  // Address of a PostgreSQL database, which may contain a password; empty: an
  // SQLite file in the state folder.
  std::string store;
  // The default address is the socket selfcald.sock in the service manager's
  // RUNTIME_DIRECTORY or, without one, in the state folder.
  ServerOptions server;
  int scoring_threads = 1;
  int solver_processes = 1;
  // Number of stored but unscored segments above which streams wait.
  int max_backlog = 64;
  SolverKind solver = SolverKind::kStructured;
  ScorerKind scorer = ScorerKind::kStructured;
  // Share of scores and calibrations that the other core computes as well.
  double verify_share = 0;
  DomainOptions domain;
  HostLimits host;  // for automatic runs
  bool idle_runs = false;
  double max_run_minutes = 30;   // a run that takes longer fails
  int max_run_memory_mib = 512;  // limit for a run; 0: no limit
  double session_idle_s = 60;    // 0: only the end of a stream ends a session
  std::string metrics = "off";   // or host:port of the loopback interface
  int metrics_rigs = 16;         // number of rigs with their own series
  UplinkOptions uplink;
  PopulationOptions population;
  std::string console = "off";      // or host:port
  Role console_role = Role::kRead;  // of users on the loopback interface
  std::string log_level = "info";
  std::string log_format = "text";
  bool check = false;  // not a setting: check the settings and exit

  friend bool operator==(const DaemonOptions&, const DaemonOptions&) = default;
};

// Fills *options. Returns the exit code if the program should exit: 0 after
// --help and --version, 2 after an error, which is explained on stderr, with
// its line if it is in the file.
std::optional<int> ParseOptions(int argc, char** argv, DaemonOptions* options);

}  // namespace selfcal::server
