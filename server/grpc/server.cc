#include "server/grpc/server.h"

#include <grpc/grpc.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <ctime>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "server/grpc/api_service.h"
#include "server/grpc/call_threads.h"
#include "server/grpc/credentials.h"
#include "server/grpc/grpc_log.h"
#include "server/grpc/watch_sender.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// Sets up gRPC once: plugins of its builder are global. Keeps the library
// initialised until the process ends: shutting it down with the last server can
// wait 10 s for a poll of a connection that a client has left open.
void SetUpLibrary() {
  static std::once_flag once;
  std::call_once(once, [] {
    grpc_init();
    RouteGrpcLog();
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
}

// The memory of messages is divided: a half is for gRPC, which ends streams
// beyond that, and most of this for reads that are admitted, so that it does
// not; the other half is for what requests become. Two of the largest messages
// have room.
std::int64_t WorkBytes(const ServerOptions& options) {
  return options.max_memory_bytes / 2;
}
std::int64_t ReadBytes(const ServerOptions& options) {
  return std::max<std::int64_t>(options.max_memory_bytes * 3 / 8,
                                options.max_receive_bytes);
}
std::int64_t QuotaBytes(const ServerOptions& options) {
  return std::max<std::int64_t>(options.max_memory_bytes / 2,
                                std::int64_t{2} * options.max_receive_bytes);
}

void SetLimits(const ServerOptions& options, grpc::ServerBuilder* builder) {
  builder->SetMaxReceiveMessageSize(options.max_receive_bytes);
  // gRPC inflates a message before it looks at its size: two megabytes become
  // two gigabytes.
  for (const auto algorithm : {GRPC_COMPRESS_DEFLATE, GRPC_COMPRESS_GZIP}) {
    builder->SetCompressionAlgorithmSupportStatus(algorithm, false);
  }
  grpc::ResourceQuota quota("selfcal");
  quota.Resize(static_cast<std::size_t>(QuotaBytes(options)));
  builder->SetResourceQuota(quota);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS,
                              options.max_streams);
  // Without the probe, a stream reads ahead by 64 KiB and no more.
  builder->AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  // Prevents two daemons from silently sharing the calls of one port.
  builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  // Detects clients that have vanished without closing, and allows clients to
  // do the same.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 60'000);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 20'000);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(
      GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 5'000);
}

// The address with the actual port in place of 0.
std::string BoundAddress(const std::string& address, int port) {
  if (address.starts_with("unix:")) return address;
  return address.substr(0, address.rfind(':') + 1) + std::to_string(port);
}

// Null without an address that uses the files.
absl::StatusOr<std::shared_ptr<const TlsReload>> StartTls(
    const ServerOptions& options,
    const std::function<void(const std::string&)>& refused) {
  const bool any = std::any_of(
      options.listen.begin(), options.listen.end(), [](const auto& address) {
        return ParseEndpoint(address).tls;
      });
  if (!any) return nullptr;
  SELFCAL_ASSIGN_OR_RETURN(
      std::shared_ptr<const TlsReload> tls,
      TlsReload::Start(
          options.tls,
          [] { return std::int64_t{std::time(nullptr)}; },
          [refused](bool in_force, const std::string& text) {
            if (in_force) {
              spdlog::info("new TLS files are in force");
              return;
            }
            spdlog::error(
                "the TLS files on disk are not taken up, those in force stay: "
                "{}",
                text);
            if (refused) refused(text);
          }));
  return tls;
}

// `tls` may be null if no address uses it.
void AddAddresses(const ServerOptions& options,
                  const std::shared_ptr<grpc::ServerCredentials>& tls,
                  grpc::ServerBuilder* builder,
                  std::vector<int>* ports) {
  for (std::size_t i = 0; i < ports->size(); ++i) {
    const Endpoint endpoint = ParseEndpoint(options.listen[i]);
    builder->AddListeningPort(
        endpoint.address,
        endpoint.tls ? tls : grpc::InsecureServerCredentials(),
        &(*ports)[i]);
  }
}

class GrpcServer final : public Server {
 public:
  GrpcServer(Api* api, const ServerOptions& options)
      : api_(api),
        reads_(ReadBytes(options), options.max_receive_bytes),
        work_(WorkBytes(options)),
        threads_(options.max_threads),
        watches_(options.max_watches) {
    const CallContext context{api,
                              options.local_role,
                              &threads_,
                              &reads_,
                              &work_,
                              options.max_receive_bytes,
                              &watches_,
                              options.max_write_time,
                              options.max_segment_streams,
                              &exchanges_};
    for (const Method& method : api->methods()) {
      const auto* service = method.descriptor->service();
      if (services_.count(service->full_name()) == 0) {
        services_[service->full_name()] = MakeApiService(*service, context);
      }
    }
  }

  ~GrpcServer() override { Shutdown(std::chrono::milliseconds(0)); }

  absl::Status Start(
      const ServerOptions& options,
      const std::function<void(const std::string&)>& tls_refused) {
    SetUpLibrary();
    grpc::ServerBuilder builder;
    SetLimits(options, &builder);
    SELFCAL_ASSIGN_OR_RETURN(tls_, StartTls(options, tls_refused));
    std::vector<int> ports(options.listen.size(), 0);
    if (tls_ != nullptr) credentials_ = TlsCredentials(tls_);
    AddAddresses(options, credentials_, &builder, &ports);
    for (const auto& [name, service] : services_) {
      builder.RegisterService(service.get());
    }
    server_ = builder.BuildAndStart();
    std::string failed;
    for (std::size_t i = 0; i < ports.size(); ++i) {
      addresses_.push_back(
          BoundAddress(ParseEndpoint(options.listen[i]).address, ports[i]));
      if (ports[i] <= 0) failed += " " + options.listen[i];
    }
    if (server_ == nullptr || !failed.empty()) {
      return absl::UnavailableError(
          "cannot listen on" + failed +
          "; check that the address is free, and that the path is writable and "
          "short enough");
    }
    for (const std::string& address : options.listen) {
      const std::string socket = ParseEndpoint(address).socket;
      if (socket.empty()) continue;
      SELFCAL_RETURN_IF_ERROR(SetPermissions(socket, options.socket));
    }
    SetHealth(true);
    return absl::OkStatus();
  }

  const std::vector<std::string>& addresses() const override {
    return addresses_;
  }

  std::shared_ptr<const TlsReload> tls() const override { return tls_; }

  void SetServing(bool serving) override {
    const std::lock_guard lock(shutdown_mutex_);
    if (!stopped_) SetHealth(serving);
  }

  void Shutdown(std::chrono::milliseconds deadline) override {
    const std::lock_guard lock(shutdown_mutex_);
    if (server_ == nullptr || std::exchange(stopped_, true)) return;
    SetHealth(false);
    api_->Stop();
    watches_.ScheduleAll();
    server_->Shutdown(std::chrono::system_clock::now() + deadline);
    server_->Wait();
  }

 private:
  void SetHealth(bool serving) {
    grpc::HealthCheckServiceInterface* health =
        server_->GetHealthCheckService();
    if (health == nullptr) return;
    health->SetServingStatus(serving);
    for (const auto& [name, service] : services_) {
      health->SetServingStatus(name, serving);
    }
  }

  Api* const api_;
  ReadGate reads_;
  MemoryPool work_;
  CallThreads threads_;
  WatchSender watches_;
  std::atomic<int> exchanges_ = 0;
  std::map<std::string, std::unique_ptr<grpc::Service>> services_;  // by name
  std::shared_ptr<const TlsReload> tls_;
  // The server asks it for the files, and does not keep it.
  std::shared_ptr<grpc::ServerCredentials> credentials_;
  std::unique_ptr<grpc::Server> server_;
  std::vector<std::string> addresses_;
  std::mutex shutdown_mutex_;
  bool stopped_ = false;  // guarded by shutdown_mutex_
};

}  // namespace

absl::StatusOr<std::unique_ptr<Server>> MakeServer(
    Api* api,
    const ServerOptions& options,
    const std::function<void(const std::string&)>& tls_refused) {
  SELFCAL_RETURN_IF_ERROR(CheckServerOptions(options));
  auto server = std::make_unique<GrpcServer>(api, options);
  if (absl::Status started = server->Start(options, tls_refused);
      !started.ok()) {
    return started;
  }
  return server;
}

}  // namespace selfcal::server
