#include "server/daemon/settings.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <limits>
#include <map>
#include <string>

#include "proto/label_text.h"
#include "server/store/postgres/store_uri.h"

namespace selfcal::server {
namespace {

constexpr int kMaxScoringThreads = 256;
constexpr int kMaxSolverProcesses = 64;
constexpr double kMaxInflation = 1e4;
constexpr int kMinMessageBytes = 1 << 20;
constexpr std::int64_t kMinMemoryBytes = 16 << 20;
constexpr std::int64_t kMaxMemoryBytes = std::int64_t{1} << 40;
constexpr int kMaxThreads = 100'000;
constexpr int kMaxWatches = 1'000'000;
constexpr int kMaxSeconds = 86'400;
constexpr int kMaxBacklog = 1'000'000;
constexpr int kMaxMetricsRigs = 1000;
constexpr int kMaxRigs = 10'000'000;
constexpr std::int64_t kMaxBytes = std::int64_t{1} << 60;
constexpr std::int64_t kMaxSegments = 1'000'000'000;
constexpr std::int64_t kMaxAgeSeconds = 1'000'000'000;
constexpr double kMaxLoad = 1000;
constexpr double kMinRunMinutes = 0.1;
constexpr double kMaxRunMinutes = 10'000;
constexpr int kMaxRunMemoryMib = 1 << 20;

class Definer {
 public:
  Definer(CLI::App* app, Environment environment)
      : app_(app), environment_(environment) {}

  template <typename T>
  CLI::Option* Add(const std::string& name, T* value, const std::string& help) {
    return Named(name, app_->add_option("--" + name, *value, help));
  }

  CLI::Option* Named(const std::string& name, CLI::Option* option) const {
    if (environment_ == Environment::kIgnore) return option;
    std::string variable = "SELFCAL_" + name;
    std::transform(
        variable.begin(), variable.end(), variable.begin(), [](char c) {
          return c == '-' ? '_' : static_cast<char>(std::toupper(c));
        });
    return option->envname(variable);
  }

  CLI::App* app() { return app_; }

 private:
  CLI::App* app_;
  Environment environment_;
};

std::map<std::string, Role> Roles() {
  return {{"read", Role::kRead},
          {"produce", Role::kProduce},
          {"administer", Role::kAdminister}};
}

std::string OctalMode(const std::string& text) {
  const bool octal = !text.empty() && text.size() <= 4 &&
                     text.find_first_not_of("01234567") == text.npos;
  return octal ? "" : "'" + text + "' is not an octal mode such as 0660";
}

// The message has no part of the text, which may contain a password.
std::string StoreAddress(const std::string& text) {
  if (text.empty()) return "";
  return std::string(ShownUri(text).status().message());
}

void DefineAccess(Definer* define, ServerOptions* options) {
  define
      ->Add("listen",
            &options->listen,
            "Address, repeatable: unix:/path, host:port (needs tls-*), or "
            "insecure:host:port, where everybody who reaches the port has "
            "local-role [unix:<runtime or state folder>/selfcald.sock]")
      ->delimiter(',');
  define->Add("socket-group",
              &options->socket.group,
              "Group of unix sockets [the group of the process]");
  define
      ->Named("socket-mode",
              define->app()->add_option_function<std::string>(
                  "--socket-mode",
                  [options](const std::string& text) {
                    options->socket.mode =
                        static_cast<unsigned>(std::stoul(text, nullptr, 8));
                  },
                  "Mode of unix sockets, octal"))
      ->check(OctalMode)
      ->default_str("0660");
  define
      ->Add("local-role",
            &options->local_role,
            "Role of callers without a certificate: read, produce or "
            "administer")
      ->transform(CLI::CheckedTransformer(Roles()))
      ->default_str("administer");
  define->Add("tls-certificate",
              &options->tls.certificate,
              "PEM file: certificate of the daemon and its chain");
  define->Add(
      "tls-key", &options->tls.key, "PEM file: key of that certificate");
  define->Add("tls-client-ca",
              &options->tls.client_ca,
              "PEM file: authority of the clients' certificates");
  define
      ->Add("tls-refresh",
            &options->tls.refresh_s,
            "Seconds between checks for changed TLS files")
      ->check(CLI::Range(1, kMaxSeconds))
      ->capture_default_str();
}

void DefineLimits(Definer* define, DaemonOptions* options) {
  ServerOptions& server = options->server;
  define
      ->Add("max-message-bytes",
            &server.max_receive_bytes,
            "Limit on the bytes of one message")
      ->check(CLI::Range(kMinMessageBytes, std::numeric_limits<int>::max()))
      ->capture_default_str();
  define
      ->Add("max-memory-bytes",
            &server.max_memory_bytes,
            "Limit on the bytes of messages in flight and of their parsed form")
      ->check(CLI::Range(kMinMemoryBytes, kMaxMemoryBytes))
      ->capture_default_str();
  define
      ->Add("max-threads",
            &server.max_threads,
            "Limit on the calls that are answered at once; each has a thread")
      ->check(CLI::Range(8, kMaxThreads))
      ->capture_default_str();
  define
      ->Add("max-watches",
            &server.max_watches,
            "Limit on open watches; they have no threads")
      ->check(CLI::Range(1, kMaxWatches))
      ->capture_default_str();
  define
      ->Add("max-streams",
            &server.max_streams,
            "Limit on concurrent calls on one connection")
      ->check(CLI::Range(1, kMaxThreads))
      ->capture_default_str();
  define
      ->Add("max-segment-streams",
            &server.max_segment_streams,
            "Limit on concurrent streams of segments; each has a thread")
      ->check(CLI::Range(1, kMaxThreads))
      ->capture_default_str();
  define
      ->Add("max-rigs",
            &options->domain.quotas.max_rigs,
            "Limit on the number of rigs")
      ->check(CLI::Range(1, kMaxRigs))
      ->capture_default_str();
  define
      ->Add("max-backlog",
            &options->max_backlog,
            "Limit on segments that wait to be scored; then streams wait")
      ->check(CLI::Range(1, kMaxBacklog))
      ->capture_default_str();
}

// Quotas; 0 disables a quota.
void DefineQuotas(Definer* define, Quotas* quotas) {
  const auto add = [&](const char* name,
                       std::int64_t* value,
                       const char* help,
                       std::int64_t most) {
    define->Add(name, value, help)
        ->check(CLI::Range(std::int64_t{0}, most))
        ->capture_default_str();
  };
  add("max-payload-bytes-per-rig",
      &quotas->max_payload_bytes_per_rig,
      "Quota of bytes for the stored data of one rig's segments; 0: no limit",
      kMaxBytes);
  add("max-segments-per-rig",
      &quotas->max_segments_per_rig,
      "Quota of segments of one rig whose metadata is kept; 0: no limit",
      kMaxSegments);
  add("max-segment-age",
      &quotas->max_segment_age_s,
      "Seconds that metadata of segments is kept; 0: no limit",
      kMaxAgeSeconds);
  add("max-database-bytes",
      &quotas->max_database_bytes,
      "Quota of bytes for the database; near it, segments are refused; 0: no "
      "limit",
      kMaxBytes);
  add("min-free-bytes",
      &quotas->min_free_bytes,
      "Bytes that stay free on the disk of the database, a twentieth of it at "
      "most; else segments are refused",
      kMaxBytes);
}

void DefineEstimation(Definer* define, DaemonOptions* options) {
  define
      ->Add("scoring-threads",
            &options->scoring_threads,
            "Threads that score segments")
      ->check(CLI::Range(1, kMaxScoringThreads))
      ->capture_default_str();
  define
      ->Add("solver-processes",
            &options->solver_processes,
            "Runs of different rigs that are computed at once")
      ->check(CLI::Range(1, kMaxSolverProcesses))
      ->capture_default_str();
  define
      ->Add("solver",
            &options->solver,
            "Solver of runs; both converge to the same minimum")
      ->transform(CLI::CheckedTransformer(std::map<std::string, SolverKind>{
          {"structured", SolverKind::kStructured},
          {"ceres", SolverKind::kCeres}}))
      ->default_str("structured");
  define
      ->Add("scorer",
            &options->scorer,
            "Scorer of segments; both agree up to rounding")
      ->transform(CLI::CheckedTransformer(std::map<std::string, ScorerKind>{
          {"structured", ScorerKind::kStructured},
          {"ceres", ScorerKind::kCeres}}))
      ->default_str("structured");
  define
      ->Add("verify-share",
            &options->verify_share,
            "Share of new scores and calibrations that the other core computes "
            "as well, while the device is idle, for comparison")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  define
      ->Add("change-inflation",
            &options->domain.change.inflation,
            "Factor on the variances of segments in the test for a device "
            "change [from the active calibration: the square of its track "
            "noise factor]")
      ->check(CLI::Range(1.0, kMaxInflation));
  define
      ->Add("change-false-alarms",
            &options->domain.change.false_alarm_rate,
            "Bound on false alarms of that test, for each segment; 0 disables "
            "the test")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
}

void DefineRuns(Definer* define, DaemonOptions* options) {
  define->Named(
      "only-on-external-power",
      define->app()->add_flag("--only-on-external-power",
                              options->host.only_on_external_power,
                              "Defer automatic runs while the machine runs on "
                              "its battery"));
  define
      ->Add("max-load",
            &options->host.max_load,
            "Defer automatic runs while the load average of the last minute, "
            "per processor, is this or more; 0: no limit")
      ->check(CLI::Range(0.0, kMaxLoad))
      ->capture_default_str();
  define
      ->Add("run-priority",
            &options->idle_runs,
            "low: a run has a lower priority than everything else, a tenth of "
            "the CPU time beside a busy process; idle: it uses only idle "
            "resources, and makes no progress while the machine is busy")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, bool>{{"idle", true}, {"low", false}}))
      ->default_str("low");
  define
      ->Add("max-run-minutes",
            &options->max_run_minutes,
            "Limit on the duration of a run; a run that takes longer fails")
      ->check(CLI::Range(kMinRunMinutes, kMaxRunMinutes))
      ->capture_default_str();
  define
      ->Add("max-run-memory",
            &options->max_run_memory_mib,
            "Limit on the memory of a run in MiB; a run that needs more fails; "
            "0: no limit")
      ->check(CLI::Range(0, kMaxRunMemoryMib))
      ->capture_default_str();
  define
      ->Add("session-idle",
            &options->session_idle_s,
            "Seconds without a segment after which the session of a rig ends; "
            "a run then starts if the tables have changed; 0: only the end of "
            "a stream ends a session")
      ->check(CLI::Range(0.0, static_cast<double>(kMaxSeconds)))
      ->capture_default_str();
}

std::map<std::string, ReportedData> ReportedDataNames() {
  return {{"none", ReportedData::kNone},
          {"kept", ReportedData::kKept},
          {"all", ReportedData::kAll}};
}

void DefineUplink(Definer* define, DaemonOptions* options) {
  UplinkOptions& uplink = options->uplink;
  define->Add("uplink",
              &uplink.hub,
              "Address of the hub to which this device reports: host:port or, "
              "without encryption, insecure:host:port or unix:/path [none]");
  define->Add("uplink-tls-ca",
              &uplink.ca,
              "PEM file: authority of the hub's certificate [those of the "
              "system]");
  define->Add("uplink-tls-certificate",
              &uplink.certificate,
              "PEM file: certificate of this device for the hub");
  define->Add(
      "uplink-tls-key", &uplink.key, "PEM file: key of that certificate");
  define
      ->Add("uplink-data",
            &uplink.data,
            "Data of segments that is reported: none, kept (what is still kept "
            "after the score) or all")
      ->transform(CLI::CheckedTransformer(ReportedDataNames()))
      ->default_str("none");
  define
      ->Add("uplink-max-bytes",
            &options->domain.quotas.max_unreported_bytes_per_rig,
            "Limit on the bytes of data of a rig that is kept only until it is "
            "reported (uplink-data all); beyond it, the oldest is not "
            "reported; 0: no limit")
      ->check(CLI::Range(std::int64_t{0}, kMaxBytes))
      ->capture_default_str();
  define
      ->Add("uplink-rate",
            &uplink.max_bytes_per_s,
            "Limit on the bytes of reports in a second, on average; 0: no "
            "limit")
      ->check(CLI::Range(std::int64_t{0}, kMaxBytes))
      ->capture_default_str();
  define
      ->Add("uplink-interval",
            &uplink.interval_s,
            "Seconds after which a report follows although nothing has "
            "changed; instructions of the hub come with its answer")
      ->check(CLI::Range(1.0, static_cast<double>(kMaxSeconds)))
      ->capture_default_str();
  define
      ->Add("uplink-role",
            &uplink.role,
            "Role of the hub when it gives instructions: read (it gives none), "
            "produce or administer")
      ->transform(CLI::CheckedTransformer(Roles()))
      ->default_str("administer");
}

void DefinePopulation(Definer* define, PopulationOptions* options) {
  define
      ->Add("cohort-label",
            &options->label,
            "Label of which each value is a cohort, whose statistics are "
            "computed and stored from time to time, e.g. model; default: none")
      ->check([](const std::string& label) {
        return label.empty() || IsLabelName(label)
                   ? ""
                   : "'" + label + "' is not the name of a label";
      });
  define
      ->Add("cohort-interval",
            &options->interval_s,
            "Seconds between these computations")
      ->check(CLI::Range(60.0, static_cast<double>(kMaxSeconds)))
      ->capture_default_str();
}

void DefineReports(Definer* define, DaemonOptions* options) {
  define
      ->Add("metrics",
            &options->metrics,
            "Address at which Prometheus reads /metrics: a loopback address "
            "such as 127.0.0.1:9464, or off")
      ->capture_default_str();
  define
      ->Add("metrics-rigs",
            &options->metrics_rigs,
            "Number of rigs with their own series: those that sent last")
      ->check(CLI::Range(0, kMaxMetricsRigs))
      ->capture_default_str();
  define
      ->Add("console",
            &options->console,
            "Address of the web console: a loopback address such as "
            "127.0.0.1:7448, another host:port (needs tls-*), or off")
      ->capture_default_str();
  define
      ->Add("console-role",
            &options->console_role,
            "Role of users who open the console on the loopback interface: "
            "read, produce or administer")
      ->transform(CLI::CheckedTransformer(Roles()))
      ->default_str("read");
  define->Add("log-level", &options->log_level, "Level of the log on stderr")
      ->check(CLI::IsMember(
          {"trace", "debug", "info", "warning", "error", "critical", "off"}))
      ->capture_default_str();
  define
      ->Add("log-format",
            &options->log_format,
            "text, or json: one object per line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
}

}  // namespace

void DefineSettings(CLI::App* app,
                    Environment environment,
                    DaemonOptions* options) {
  Definer define(app, environment);
  define.Add("state-dir",
             &options->state_dir,
             "Folder of the database and the lock; created if it does not "
             "exist [STATE_DIRECTORY]");
  define
      .Add("store",
           &options->store,
           "Address of a PostgreSQL database, "
           "postgresql://user@host:port/database; better without a password, "
           "see ~/.pgpass [an SQLite file in the state folder]")
      ->check(StoreAddress);
  DefineAccess(&define, &options->server);
  DefineLimits(&define, options);
  DefineQuotas(&define, &options->domain.quotas);
  DefineEstimation(&define, options);
  DefineRuns(&define, options);
  DefineUplink(&define, options);
  DefinePopulation(&define, &options->population);
  DefineReports(&define, options);
}

}  // namespace selfcal::server
