// selfcald: keeps the calibrations of camera-IMU devices up to date.
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <optional>
#include <string>
#include <string_view>

#include "server/daemon/heap.h"
#include "server/daemon/log.h"
#include "server/daemon/options.h"
#include "server/daemon/serve.h"
#include "server/daemon/stop.h"
#include "server/worker/worker.h"

int main(int argc, char** argv) {
  using namespace selfcal::server;
  if (argc == 2 && std::string_view(argv[1]) == kWorkerArgument) {
    return RunWorker();
  }
  KeepHeapSmall();
  DaemonOptions options;
  if (const auto exit_code = ParseOptions(argc, argv, &options)) {
    return *exit_code;
  }
  // Files are readable by their owner only.
  umask(S_IRWXG | S_IRWXO);
  // The daemon must not end when the reader of its log does.
  signal(SIGPIPE, SIG_IGN);
  BlockSignals();
  try {
    SetUpLog(options.log_level, options.log_format);
    if (options.check) return Check(options);
    return Serve(options, [&]() -> std::optional<std::string> {
      DaemonOptions now;
      if (ParseOptions(argc, argv, &now)) return std::nullopt;
      return now.log_level;
    });
  } catch (const std::exception& error) {
    spdlog::critical("{}", error.what());
    return EXIT_FAILURE;
  }
}
