#include "client/selfcal/connection.h"

#include <fmt/format.h>
#include <grpc/grpc.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>

#include <exception>
#include <fstream>
#include <mutex>
#include <random>
#include <sstream>
#include <utility>

namespace selfcal::client {

namespace {

// Keeps gRPC initialised until the process ends: shutting it down with the last
// channel can wait 10 s for a poll of that channel.
void KeepLibrary() {
  static std::once_flag once;
  std::call_once(once, [] { grpc_init(); });
}

std::shared_ptr<grpc::Channel> MakeChannel(
    const std::string& target,
    const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
  KeepLibrary();
  grpc::ChannelArguments arguments;
  // A shared connection that failed would impose its own backoff.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // Detects that the peer is gone without having closed the connection. By
  // default, servers allow a ping every five minutes.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 6 * 60 * 1000);
  // The data of a segment may be larger than the default of 4 MiB.
  arguments.SetMaxReceiveMessageSize(-1);
  return grpc::CreateCustomChannel(target, credentials, arguments);
}

// Returns the content of the file, or an empty string for an empty path.
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

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(
    const ClientOptions& options) {
  const bool has_own =
      !options.certificate_file.empty() || !options.key_file.empty();
  if (options.ca_file.empty() && !has_own) return MakeChannel(options.target);
  if (options.certificate_file.empty() != options.key_file.empty()) {
    return absl::FailedPreconditionError(
        "certificate_file and key_file must be given together");
  }
  grpc::SslCredentialsOptions tls;
  for (const auto& [path, pem] :
       {std::pair(&options.ca_file, &tls.pem_root_certs),
        std::pair(&options.certificate_file, &tls.pem_cert_chain),
        std::pair(&options.key_file, &tls.pem_private_key)}) {
    auto read = ReadPem(*path);
    if (!read.ok()) return read.status();
    *pem = *std::move(read);
  }
  return MakeChannel(options.target, grpc::SslCredentials(tls));
}

std::shared_ptr<grpc::Channel> MakeChannel(const std::string& target) {
  return MakeChannel(target, grpc::InsecureChannelCredentials());
}

absl::Status ToAbsl(const grpc::Status& status) {
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()),
                      status.error_message());
}

std::uint64_t JitterSeed(const void* object) {
  const auto address = reinterpret_cast<std::uintptr_t>(object);
  try {
    return address ^ std::random_device{}();
  } catch (const std::exception&) {
    return address;  // no entropy on this device: only jitter suffers
  }
}

}  // namespace selfcal::client
