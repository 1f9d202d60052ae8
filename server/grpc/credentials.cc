#include "server/grpc/credentials.h"

#include <grp.h>
#include <grpc/grpc.h>
#include <grpc/grpc_security.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr std::string_view kInsecure = "insecure:";
constexpr std::string_view kUnix = "unix:";
constexpr std::size_t kMaxGroupBuffer = 1 << 16;

// Returns the number of a group; nullopt if no group has this name.
std::optional<gid_t> FindGroup(const std::string& name) {
  group entry{};
  group* found = nullptr;
  std::vector<char> buffer(kMaxGroupBuffer);
  getgrnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found);
  return found == nullptr ? std::nullopt : std::optional(found->gr_gid);
}

// Gives each connection that begins the files that are in force. The interface
// of gRPC in C++ only has files that it reads itself, and takes up whatever
// they contain.
class ReloadedCredentials final : public grpc::ServerCredentials {
 public:
  explicit ReloadedCredentials(std::shared_ptr<const TlsReload> tls)
      : tls_(std::move(tls)),
        credentials_(grpc_ssl_server_credentials_create_with_options(
            grpc_ssl_server_credentials_create_options_using_config_fetcher(
                GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY,
                &ReloadedCredentials::Fetch,
                this))) {}
  ~ReloadedCredentials() override {
    grpc_server_credentials_release(credentials_);
  }

  void SetAuthMetadataProcessor(
      const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {}

 private:
  int AddPortToServer(const std::string& address,
                      grpc_server* server) override {
    return grpc_server_add_http2_port(server, address.c_str(), credentials_);
  }

  // Called by gRPC at the start and for each new connection, one at a time.
  static grpc_ssl_certificate_config_reload_status Fetch(
      void* self, grpc_ssl_server_certificate_config** config) {
    return static_cast<ReloadedCredentials*>(self)->FetchNew(config);
  }

  grpc_ssl_certificate_config_reload_status FetchNew(
      grpc_ssl_server_certificate_config** config) {
    const auto current = tls_->Current();
    if (current == given_) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
    const grpc_ssl_pem_key_cert_pair pair = {current->key.c_str(),
                                             current->certificate.c_str()};
    *config = grpc_ssl_server_certificate_config_create(
        current->client_ca.c_str(), &pair, 1);
    given_ = current;
    return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
  }

  const std::shared_ptr<const TlsReload> tls_;
  std::shared_ptr<const TlsFiles> given_;  // to gRPC
  grpc_server_credentials* const credentials_;
};

}  // namespace

Endpoint ParseEndpoint(const std::string& address) {
  if (address.starts_with(kInsecure)) {
    return {address.substr(kInsecure.size()), false, ""};
  }
  if (!address.starts_with(kUnix)) return {address, true, ""};
  std::string path = address.substr(kUnix.size());
  if (path.starts_with("//")) path = path.substr(2);
  return {address, false, path};
}

std::shared_ptr<grpc::ServerCredentials> TlsCredentials(
    std::shared_ptr<const TlsReload> tls) {
  return std::make_shared<ReloadedCredentials>(std::move(tls));
}

absl::Status SetPermissions(const std::string& path,
                            const SocketOptions& options) {
  if (!options.group.empty()) {
    const auto group = FindGroup(options.group);
    if (!group || chown(path.c_str(), static_cast<uid_t>(-1), *group) != 0) {
      return absl::FailedPreconditionError(
          "cannot set the group of " + path + " to '" + options.group +
          "'; the daemon must be a member of the group");
    }
  }
  if (chmod(path.c_str(), options.mode) != 0) {
    return absl::FailedPreconditionError("cannot set the mode of " + path +
                                         ": " + std::strerror(errno));
  }
  return absl::OkStatus();
}

absl::Status CheckServerOptions(const ServerOptions& options) {
  if (options.listen.empty()) {
    return absl::InvalidArgumentError("no address to listen on");
  }
  if (!options.socket.group.empty() && !FindGroup(options.socket.group)) {
    return absl::InvalidArgumentError(
        "there is no group '" + options.socket.group + "' for the socket");
  }
  for (const std::string& address : options.listen) {
    if (!ParseEndpoint(address).tls) continue;
    const TlsOptions& tls = options.tls;
    if (tls.certificate.empty() || tls.key.empty() || tls.client_ca.empty()) {
      return absl::InvalidArgumentError(
          "a TCP address needs tls-certificate, tls-key and tls-client-ca; "
          "without encryption and authentication it must be explicit: "
          "insecure:host:port");
    }
    SELFCAL_RETURN_IF_ERROR(ReadTlsFiles(tls, std::time(nullptr)).status());
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
