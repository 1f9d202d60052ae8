#include "server/daemon/options.h"

#include <CLI/CLI.hpp>
#include <map>
#include <string>

namespace selfcal::server {
namespace {

constexpr int kUsageError = 2;
constexpr int kMaxScoringThreads = 256;
constexpr double kMaxInflation = 1e4;
constexpr double kMaxLoad = 1000;
constexpr double kMinRunMinutes = 0.1;
constexpr double kMaxRunMinutes = 10'000;

}  // namespace

std::optional<int> ParseOptions(int argc, char** argv, DaemonOptions* options) {
  CLI::App app(
      "selfcald scores motion segments, keeps the most informative ones and "
      "calibrates cameras and IMU on them.");
  app.set_version_flag("--version", "selfcald " SELFCAL_VERSION);
  app.set_config("--config", "", "Read options from a TOML file");
  // A misspelt key must not be taken for a default.
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.add_option("--state-dir",
                 options->state_dir,
                 "Folder of the database, the lock and the socket; created if "
                 "it does not exist")
      ->envname("STATE_DIRECTORY")
      ->required();
  app.add_option("--listen",
                 options->listen,
                 "Address, repeatable: unix:/path or host:port "
                 "[unix:<state-dir>/selfcald.sock]. There is no "
                 "authentication: do not listen on a network you do not trust");
  app.add_option("--scoring-threads",
                 options->scoring_threads,
                 "Threads that score segments")
      ->check(CLI::Range(1, kMaxScoringThreads))
      ->capture_default_str();
  app.add_option("--solver",
                 options->solver,
                 "What solves recalibrations; both lead to the same minimum")
      ->transform(CLI::CheckedTransformer(std::map<std::string, SolverKind>{
          {"structured", SolverKind::kStructured},
          {"ceres", SolverKind::kCeres}}))
      ->default_str("structured");
  app.add_option("--change-inflation",
                 options->change.inflation,
                 "Factor on the variances of segments in the test for a "
                 "change of the device [what the active calibration found: the "
                 "square of its track noise factor]")
      ->check(CLI::Range(1.0, kMaxInflation));
  app.add_option("--change-false-alarms",
                 options->change.false_alarm_rate,
                 "Bound on false alarms of that test, for each segment; 0 "
                 "turns it off")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_flag("--only-on-external-power",
               options->host.only_on_external_power,
               "Hold runs back while the machine runs on its battery, unless "
               "they are asked for");
  app.add_option("--max-load",
                 options->host.max_load,
                 "Hold runs back while the load of the last minute, for each "
                 "processor, is this or more; 0: no matter")
      ->check(CLI::Range(0.0, kMaxLoad))
      ->capture_default_str();
  app.add_option("--run-priority",
                 options->idle_runs,
                 "idle: a run takes only what nobody else wants, and does not "
                 "get on while the machine is busy; low: it stands behind "
                 "everything else")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, bool>{{"idle", true}, {"low", false}}))
      ->default_str("idle");
  app.add_option("--max-run-minutes",
                 options->max_run_minutes,
                 "A run that takes longer fails")
      ->check(CLI::Range(kMinRunMinutes, kMaxRunMinutes))
      ->capture_default_str();
  app.add_option("--log-level", options->log_level, "What goes to stderr")
      ->check(CLI::IsMember(
          {"trace", "debug", "info", "warning", "error", "critical", "off"}))
      ->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kUsageError;
  }
  if (options->listen.empty()) {
    const auto socket =
        std::filesystem::absolute(options->state_dir) / "selfcald.sock";
    options->listen.push_back("unix:" + socket.string());
  }
  return std::nullopt;
}

}  // namespace selfcal::server
