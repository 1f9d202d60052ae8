// selfcald: wires the store, the pipeline and the gRPC server, and runs them
// until it is told to stop.
#include <fmt/ranges.h>
#include <signal.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <chrono>
#include <cstdlib>
#include <memory>
#include <optional>
#include <ratio>
#include <string>

#include "server/daemon/options.h"
#include "server/daemon/state_lock.h"
#include "server/daemon/stop.h"
#include "server/pipeline/pipeline.h"
#include "server/service/server.h"
#include "server/store/store_sqlite.h"

namespace selfcal::server {
namespace {

// A stop is over within 10 s, of which calls get a part to end by themselves.
constexpr std::chrono::milliseconds kStopLimit{9500};
constexpr std::chrono::milliseconds kCallLimit{2000};

void SetUpLog(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("selfcald"));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %^%l%$ %v",
                      spdlog::pattern_time_type::utc);
  spdlog::set_level(spdlog::level::from_str(level));
  spdlog::flush_on(spdlog::level::trace);
}

int Failed(const std::string& what, const absl::Status& status) {
  spdlog::error("{}: {}", what, status.ToString());
  return EXIT_FAILURE;
}

int Serve(const DaemonOptions& options) {
  // First, so that it watches over the end of all that follows.
  std::optional<StopDeadline> deadline;
  const auto lock = StateLock::Take(options.state_dir);
  if (!lock.ok()) return Failed("cannot start", lock.status());
  const std::string database = (options.state_dir / "selfcal.db").string();
  const auto store = MakeSqliteStore(database, options.change);
  if (!store.ok()) return Failed("cannot open " + database, store.status());

  PipelineOptions pipeline_options;
  pipeline_options.scoring_threads = options.scoring_threads;
  pipeline_options.program_version = SELFCAL_VERSION;
  pipeline_options.calibrate.solver = options.solver;
  const auto conditions = MakeHostConditions(options.host);
  pipeline_options.conditions = conditions.get();
  pipeline_options.idle_runs = options.idle_runs;
  pipeline_options.max_run_time = std::chrono::round<std::chrono::milliseconds>(
      std::chrono::duration<double, std::ratio<60>>(options.max_run_minutes));
  const auto pipeline = MakePipeline(store->get(), pipeline_options);
  if (absl::Status started = pipeline->Start(); !started.ok()) {
    return Failed("cannot start the pipeline", started);
  }
  ServerOptions server_options;
  server_options.listen = options.listen;
  const auto server = MakeServer(store->get(), pipeline.get(), server_options);
  if (!server.ok()) {
    pipeline->Stop();
    return Failed("cannot serve", server.status());
  }
  spdlog::info("selfcald ready: listening on {}",
               fmt::join((*server)->addresses(), ", "));

  const int signal = WaitForStop();
  deadline.emplace(kStopLimit);
  spdlog::info("stopping on {}", signal == SIGINT ? "SIGINT" : "SIGTERM");
  (*server)->Shutdown(kCallLimit);
  pipeline->Stop();
  spdlog::info("stopped");
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace selfcal::server

int main(int argc, char** argv) {
  using namespace selfcal::server;
  DaemonOptions options;
  if (const auto exit_code = ParseOptions(argc, argv, &options)) {
    return *exit_code;
  }
  // Nobody but the owner reads what it writes.
  umask(S_IRWXG | S_IRWXO);
  // A reader of the log that goes away must not end the daemon.
  signal(SIGPIPE, SIG_IGN);
  BlockStopSignals();
  try {
    SetUpLog(options.log_level);
    return Serve(options);
  } catch (const std::exception& error) {
    spdlog::critical("{}", error.what());
    return EXIT_FAILURE;
  }
}
