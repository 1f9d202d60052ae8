#include "server/grpc/grpc_log.h"

#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <memory>
#include <string>
#include <string_view>

namespace selfcal::server {
namespace {

// Returns a logger that is never destroyed, because threads of gRPC may outlive
// main.
const std::shared_ptr<spdlog::logger>& Logger() {
  static const auto* const logger =
      new std::shared_ptr<spdlog::logger>(spdlog::default_logger());
  return *logger;
}

std::atomic<bool> stopped_accepting = false;

void Log(gpr_log_func_args* line) {
  if (std::string_view(line->message).starts_with("Failed accept4")) {
    stopped_accepting = true;
  }
  // Most errors of gRPC are failures of one connection.
  const bool is_error = line->severity == GPR_LOG_SEVERITY_ERROR;
  Logger()->log(is_error ? spdlog::level::warn : spdlog::level::debug,
                "grpc: {}",
                line->message);
}

// Drops messages of protobuf: they are about the data of callers, who could
// flood the log.
void LogProtobuf(google::protobuf::LogLevel,
                 const char*,
                 int,
                 const std::string& message) {
  Logger()->debug("protobuf: {}", message);
}

}  // namespace

void RouteGrpcLog() {
  Logger();
  gpr_set_log_function(Log);
  google::protobuf::SetLogHandler(LogProtobuf);
}

bool HasStoppedAccepting() { return stopped_accepting; }

}  // namespace selfcal::server
