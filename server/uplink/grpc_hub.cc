#include <fmt/format.h>
#include <grpcpp/client_context.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>

#include <chrono>
#include <fstream>
#include <mutex>
#include <sstream>
#include <string_view>
#include <utility>

#include "selfcal/v1/uplink.grpc.pb.h"
#include "server/uplink/hub.h"

namespace selfcal::server {
namespace {

constexpr std::string_view kInsecure = "insecure:";
constexpr std::string_view kUnix = "unix:";

// A call takes at most this long, and as long as its bytes take at 8 KiB/s.
constexpr std::chrono::seconds kLimit{60};
constexpr std::size_t kSlowestBytesPerSecond = 8192;

bool IsEncrypted(const std::string& hub) {
  return !hub.starts_with(kInsecure) && !hub.starts_with(kUnix);
}

absl::StatusOr<std::string> ReadPem(const std::string& path) {
  if (path.empty()) return std::string();
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file || text.str().empty()) {
    return absl::FailedPreconditionError(
        fmt::format("cannot read {} as a PEM file", path));
  }
  return text.str();
}

absl::StatusOr<grpc::SslCredentialsOptions> ReadTls(
    const UplinkOptions& options) {
  grpc::SslCredentialsOptions tls;
  for (const auto& [path, pem] :
       {std::pair(&options.ca, &tls.pem_root_certs),
        std::pair(&options.certificate, &tls.pem_cert_chain),
        std::pair(&options.key, &tls.pem_private_key)}) {
    auto read = ReadPem(*path);
    if (!read.ok()) return read.status();
    *pem = *std::move(read);
  }
  return tls;
}

absl::Status Cancelled() {
  return absl::CancelledError("the daemon is stopping");
}

class GrpcHub final : public Hub {
 public:
  explicit GrpcHub(UplinkOptions options) : options_(std::move(options)) {}

  absl::StatusOr<v1::ReportResponse> Report(
      const v1::ReportRequest& request) override {
    if (stub_ == nullptr) {
      const absl::Status connected = Connect();
      if (!connected.ok()) return connected;
    }
    grpc::ClientContext context;
    const auto seconds =
        std::chrono::seconds(request.ByteSizeLong() / kSlowestBytesPerSecond);
    context.set_deadline(std::chrono::system_clock::now() + kLimit + seconds);
    {
      const std::lock_guard lock(mutex_);
      if (cancelled_) return Cancelled();
      under_way_ = &context;
    }
    v1::ReportResponse response;
    const grpc::Status status = stub_->Report(&context, request, &response);
    const std::lock_guard lock(mutex_);
    under_way_ = nullptr;
    if (cancelled_) return Cancelled();
    if (status.ok()) return response;
    stub_.reset();
    return absl::Status(static_cast<absl::StatusCode>(status.error_code()),
                        status.error_message());
  }

  void Cancel() override {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
    if (under_way_ != nullptr) under_way_->TryCancel();
  }

 private:
  absl::Status Connect() {
    std::shared_ptr<grpc::ChannelCredentials> credentials =
        grpc::InsecureChannelCredentials();
    std::string target = options_.hub;
    if (target.starts_with(kInsecure)) target.erase(0, kInsecure.size());
    if (IsEncrypted(options_.hub)) {
      const auto tls = ReadTls(options_);
      // The hub was not asked, so it has refused nothing.
      if (!tls.ok()) return absl::UnavailableError(tls.status().message());
      credentials = grpc::SslCredentials(*tls);
    }
    grpc::ChannelArguments arguments;
    // A shared connection that failed would impose its own backoff.
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    stub_ = v1::UplinkService::NewStub(
        grpc::CreateCustomChannel(target, credentials, arguments));
    return absl::OkStatus();
  }

  const UplinkOptions options_;
  std::unique_ptr<v1::UplinkService::Stub> stub_;  // of the thread that reports
  std::mutex mutex_;                               // guards what follows
  grpc::ClientContext* under_way_ = nullptr;
  bool cancelled_ = false;
};

}  // namespace

std::unique_ptr<Hub> MakeGrpcHub(const UplinkOptions& options) {
  return std::make_unique<GrpcHub>(options);
}

absl::Status CheckUplink(const UplinkOptions& options) {
  const bool has_tls = !options.ca.empty() || !options.certificate.empty() ||
                       !options.key.empty();
  if (options.hub.empty()) {
    if (!has_tls) return absl::OkStatus();
    return absl::InvalidArgumentError(
        "uplink-tls-* have no effect without uplink: set it, or remove them");
  }
  if (!IsEncrypted(options.hub)) {
    if (!has_tls) return absl::OkStatus();
    return absl::InvalidArgumentError(
        "uplink names a connection that is not encrypted, and uplink-tls-* are "
        "set: remove either");
  }
  if (options.certificate.empty() != options.key.empty()) {
    return absl::InvalidArgumentError(
        "set both uplink-tls-certificate and uplink-tls-key, or neither");
  }
  return ReadTls(options).status();
}

}  // namespace selfcal::server
