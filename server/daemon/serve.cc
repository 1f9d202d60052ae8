#include "server/daemon/serve.h"

#include <fmt/ranges.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "server/api/api.h"
#include "server/console/console.h"
#include "server/daemon/heap.h"
#include "server/daemon/log.h"
#include "server/daemon/open_store.h"
#include "server/daemon/service_manager.h"
#include "server/daemon/startable.h"
#include "server/daemon/state_lock.h"
#include "server/daemon/stop.h"
#include "server/domain/device_clock.h"
#include "server/domain/domain.h"
#include "server/grpc/grpc_log.h"
#include "server/host/host_conditions.h"
#include "server/host/machine_clocks.h"
#include "server/metrics/metrics.h"
#include "server/pipeline/pipeline.h"
#include "server/population/population.h"
#include "server/status/status_macros.h"
#include "server/store/outbox.h"
#include "server/uplink/uplink.h"
#include "server/worker/worker.h"

namespace selfcal::server {
namespace {

// A stop takes less than 10 s; calls get a part of it to end by themselves.
constexpr std::chrono::milliseconds kStopLimit{9500};
constexpr std::chrono::milliseconds kCallLimit{2000};
// Interval of checks that the addresses still accept connections.
constexpr std::chrono::milliseconds kLookAfter{1000};

int Failed(const std::string& what, const absl::Status& status) {
  spdlog::error("{}: {}", what, status.ToString());
  return EXIT_FAILURE;
}

// Raises the limit of open files as far as the system permits, because each
// connection takes a file descriptor.
void RaiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

PipelineOptions OptionsOfPipeline(const DaemonOptions& options,
                                  const DeviceClock* clock,
                                  Conditions* conditions,
                                  PipelineObserver* observer) {
  PipelineOptions pipeline;
  pipeline.now_ns = [clock] { return clock->Now().steady_ns; };
  pipeline.replica.shared = !options.store.empty();
  pipeline.scoring_threads = options.scoring_threads;
  pipeline.solver_processes = options.solver_processes;
  pipeline.max_backlog = options.max_backlog;
  pipeline.program_version = SELFCAL_VERSION;
  pipeline.calibrate.solver = options.solver;
  pipeline.scorer = options.scorer;
  pipeline.verify_share = options.verify_share;
  pipeline.conditions = conditions;
  pipeline.session_idle = std::chrono::round<std::chrono::milliseconds>(
      std::chrono::duration<double>(options.session_idle_s));
  pipeline.max_run_time = std::chrono::round<std::chrono::milliseconds>(
      std::chrono::duration<double, std::ratio<60>>(options.max_run_minutes));
  pipeline.observer = observer;
  return pipeline;
}

// Estimators that calibrate, and score for verifications, in a worker process.
Estimators EstimatorsOfPipeline(const DaemonOptions& options) {
  WorkerLimits limits;
  limits.idle = options.idle_runs;
  limits.max_memory_bytes = std::int64_t{options.max_run_memory_mib} << 20;
  Estimators estimators = CoreEstimators();
  if (options.scorer == ScorerKind::kCeres) {
    estimators.score = [](const auto&... input) {
      return ScoreSegmentBy(ScorerKind::kCeres, input...);
    };
  }
  const std::vector<std::string> worker = {"/proc/self/exe", kWorkerArgument};
  estimators.calibrate = [worker, limits](const auto&... input) {
    return CalibrateInWorker(worker, limits, input...);
  };
  estimators.score_by = [worker, limits](const auto&... input) {
    return ScoreInWorker(worker, limits, input...);
  };
  return estimators;
}

absl::StatusOr<std::unique_ptr<Metrics>> OpenMetrics(
    const DaemonOptions& options, const OpenedStore& opened) {
  if (options.metrics == "off") return nullptr;
  MetricsOptions metrics;
  metrics.address = options.metrics;
  metrics.rigs = options.metrics_rigs;
  metrics.program_version = SELFCAL_VERSION;
  metrics.database = opened.file;
  auto made = MakeMetrics(opened.store.get(), metrics);
  if (made.ok()) spdlog::info("metrics: {}", (*made)->url());
  return made;
}

ConsoleOptions OptionsOfConsole(const DaemonOptions& options) {
  return {options.console, options.console_role, options.server.tls};
}

// Returns an error if the settings require Ceres and this build does not have
// it.
absl::Status CheckCeres(const DaemonOptions& options) {
  if (HasCeres()) return absl::OkStatus();
  const bool scores = options.scorer == ScorerKind::kCeres;
  if (!scores && options.verify_share == 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{}: this program was built without Ceres; remove the "
                  "setting, or use a build with SELFCAL_CERES=ON",
                  scores ? "scorer" : "verify-share"));
}

absl::Status CheckUplinkSettings(const DaemonOptions& options) {
  SELFCAL_RETURN_IF_ERROR(CheckUplink(options.uplink));
  if (options.uplink.hub.empty() || options.store.empty()) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "uplink is for a device, whose records are in a file; a hub on a "
      "database reports to no other: remove uplink or store");
}

// Checks what can be checked without the state directory and the addresses.
absl::Status CheckSettings(const DaemonOptions& options) {
  SELFCAL_RETURN_IF_ERROR(CheckCeres(options));
  SELFCAL_RETURN_IF_ERROR(CheckStoreSettings(options));
  SELFCAL_RETURN_IF_ERROR(CheckServerOptions(options.server));
  SELFCAL_RETURN_IF_ERROR(CheckUplinkSettings(options));
  if (options.metrics != "off") {
    SELFCAL_RETURN_IF_ERROR(CheckMetricsAddress(options.metrics));
  }
  if (options.console == "off") return absl::OkStatus();
  return CheckConsole(OptionsOfConsole(options));
}

// Opens the console; null if it is off.
absl::StatusOr<std::unique_ptr<Console>> OpenConsole(
    const DaemonOptions& options, const Api* api) {
  if (options.console == "off") return nullptr;
  auto opened = MakeConsole(api, OptionsOfConsole(options));
  if (opened.ok()) spdlog::info("console: {}", (*opened)->url());
  return opened;
}

// Starts to report to the hub; null if there is none.
absl::StatusOr<std::unique_ptr<Uplink>> OpenUplink(const DaemonOptions& options,
                                                   Store* store,
                                                   const Api* api) {
  if (options.uplink.hub.empty()) {
    SELFCAL_RETURN_IF_ERROR(store->outbox()->Close());
    return nullptr;
  }
  auto uplink = std::make_unique<Uplink>(
      store, api, MakeGrpcHub(options.uplink), options.uplink, SELFCAL_VERSION);
  SELFCAL_RETURN_IF_ERROR(uplink->Start());
  spdlog::info("uplink: reporting to {}", options.uplink.hub);
  return uplink;
}

// What the daemon has on disk, while it runs.
struct State {
  const StateLock& lock;
  const OpenedStore& store;

  bool IsInPlace() const { return lock.IsInPlace() && store.IsInPlace(); }
};

void LookAtClock(DeviceClock* clock) {
  const auto step = clock->Observe();
  if (!step.ok()) {
    spdlog::error("cannot store the clock: {}", step.status().ToString());
  } else if (*step) {
    spdlog::warn("{}", **step);
  }
}

// Runs until a signal to stop, which it returns, with a health that follows the
// database; nullopt if an address has
// stopped accepting connections, or the state directory is not in place. If the
// store does not respond any more, the watchdog is not notified.
std::optional<int> RunUntilStopped(
    Store* store,
    Pipeline* pipeline,
    Server* server,
    DeviceClock* clock,
    const State& state,
    const std::function<std::optional<std::string>()>& read_log_level) {
  const auto watchdog = WatchdogInterval();
  const auto interval = std::min(watchdog.value_or(kLookAfter), kLookAfter);
  while (!HasStoppedAccepting() && state.IsInPlace()) {
    const auto signal = WaitForSignal(interval);
    TrimHeap();
    LookAtClock(clock);
    server->SetServing(pipeline->StoreResponds());
    if (!signal && watchdog) {
      store->ListRigs({1, ""}).IgnoreError();
      NotifyAlive();
    } else if (signal == SIGHUP) {
      const auto level = read_log_level();
      if (level) SetLogLevel(*level);
      spdlog::info("log level: {}", level.value_or("unchanged"));
    } else if (signal) {
      return signal;
    }
  }
  return std::nullopt;
}

// Serves from a start to a stop. Returns the exit code, or nullopt if a
// restored database is ready for the next start.
std::optional<int> ServeOnce(
    const DaemonOptions& options,
    const std::function<std::optional<std::string>()>& read_log_level) {
  // Declared first, so that it limits the time in which everything below ends.
  std::optional<StopDeadline> deadline;
  RaiseFileLimit();
  // A start that the settings prevent leaves the state directory as it is.
  if (absl::Status status = CheckSettings(options); !status.ok()) {
    return Failed("the settings are invalid", status);
  }
  const auto lock = StateLock::Take(options.state_dir);
  if (!lock.ok()) return Failed("cannot start", lock.status());
  NotifyStatus("opening the database, with migrations if it is older");
  const auto opened = OpenStore(options, NowNs());
  if (!opened.ok()) {
    return Failed("cannot open " + StoreName(options), opened.status());
  }
  if (!options.store.empty()) {
    spdlog::info("database: {}", StoreName(options));
  }
  const State state{*lock, *opened};
  Store* const store = opened->store.get();
  const auto clock = DeviceClock::Open(store, MachineClocks());
  if (!clock.ok()) return Failed("cannot start", clock.status());
  Domain domain(store, options.domain, [&] { return (*clock)->Now(); });
  const auto metrics = OpenMetrics(options, *opened);
  if (!metrics.ok()) return Failed("cannot start", metrics.status());

  EventFeed changes(store,
                    *metrics == nullptr ? nullptr : (*metrics)->observer());
  const auto conditions = MakeHostConditions(options.host);
  const auto pipeline = MakePipeline(
      &domain,
      OptionsOfPipeline(options, clock->get(), conditions.get(), &changes),
      EstimatorsOfPipeline(options));
  if (absl::Status started = pipeline->Start(); !started.ok()) {
    return Failed("cannot start the pipeline", started);
  }
  Api api(&domain, pipeline.get(), &changes, {RequestRestart, SELFCAL_VERSION});
  auto console = OpenConsole(options, &api);
  if (!console.ok()) {
    pipeline->Stop();
    return Failed("cannot open the console", console.status());
  }
  const auto server =
      MakeServer(&api, options.server, [&domain](const std::string& reason) {
        const absl::Status recorded =
            domain.RecordEvent(EventKind::kTlsFilesRefused, reason);
        if (!recorded.ok()) spdlog::error("event: {}", recorded.ToString());
      });
  if (!server.ok()) {
    pipeline->Stop();
    return Failed("cannot serve", server.status());
  }
  if (*metrics != nullptr) (*metrics)->AddTls((*server)->tls());
  Population population(
      &domain, options.population, [&] { return (*clock)->Now().time_ns; });
  const auto uplink = OpenUplink(options, store, &api);
  if (!uplink.ok()) {
    (*server)->Shutdown(kCallLimit);
    pipeline->Stop();
    return Failed("cannot report to the hub", uplink.status());
  }
  population.Start();
  spdlog::info("selfcald ready: listening on {}",
               fmt::join((*server)->addresses(), ", "));
  NotifyReady();

  const auto signal = RunUntilStopped(store,
                                      pipeline.get(),
                                      server->get(),
                                      clock->get(),
                                      state,
                                      read_log_level);
  deadline.emplace(kStopLimit);
  NotifyStopping();
  if (signal == kRestart) {
    spdlog::info("stopping, to restart with the restored database");
  } else if (signal) {
    spdlog::info("stopping on {}", signal == SIGINT ? "SIGINT" : "SIGTERM");
  } else if (!state.IsInPlace()) {
    spdlog::error(
        "stopping: the state directory {} or its database was removed or "
        "replaced while it was in use; put it back, or restore a backup, and "
        "start selfcald again",
        options.state_dir.string());
  } else {
    spdlog::error(
        "stopping, to be restarted: the limit of open files was reached, and "
        "no new connections are accepted");
  }
  population.Stop();
  if (*uplink != nullptr) (*uplink)->Stop();
  api.Stop();
  console->reset();
  (*server)->Shutdown(kCallLimit);
  pipeline->Stop();
  spdlog::info("stopped");
  if (signal == kRestart) return std::nullopt;
  return signal ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace

int Check(const DaemonOptions& options) {
  absl::Status status = CheckSettings(options);
  if (!status.ok()) return Failed("the settings are invalid", status);
  status = CheckStateFolder(options.state_dir);
  if (status.ok()) status = CheckStoreServer(options);
  if (status.ok()) {
    std::vector<std::string> ports;
    if (options.metrics != "off") ports.push_back(options.metrics);
    if (options.console != "off") ports.push_back(options.console);
    status = CheckAddresses(options.state_dir, options.server.listen, ports);
  }
  if (!status.ok()) return Failed("the daemon cannot start", status);
  spdlog::info("the settings are valid; state-dir {}, listening on {}",
               options.state_dir.string(),
               fmt::join(options.server.listen, ", "));
  return EXIT_SUCCESS;
}

int Serve(const DaemonOptions& options,
          const std::function<std::optional<std::string>()>& read_log_level) {
  for (;;) {
    const auto exit_code = ServeOnce(options, read_log_level);
    if (exit_code) return *exit_code;
  }
}

}  // namespace selfcal::server
