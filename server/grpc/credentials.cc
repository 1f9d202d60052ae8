#include "server/grpc/credentials.h"

#include <grp.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

namespace selfcal::server {
namespace {

constexpr std::string_view kInsecure = "insecure:";
constexpr std::string_view kUnix = "unix:";
constexpr std::size_t kMaxGroupBuffer = 1 << 16;

// An error with OpenSSL's message for the last failure, which never quotes the
// file.
absl::Status Unusable(const std::string& what, const std::string& path) {
  const char* reason = ERR_reason_error_string(ERR_get_error());
  ERR_clear_error();
  return absl::FailedPreconditionError(
      "cannot use the " + what + " " + path + ": " +
      (reason == nullptr ? "it is not a PEM file" : reason));
}

// Prevents OpenSSL from prompting at the terminal for an encrypted key.
int NoPassphrase(char*, int, int, void*) { return 0; }

// Returns the number of a group; nullopt if no group has this name.
std::optional<gid_t> FindGroup(const std::string& name) {
  group entry{};
  group* found = nullptr;
  std::vector<char> buffer(kMaxGroupBuffer);
  getgrnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found);
  return found == nullptr ? std::nullopt : std::optional(found->gr_gid);
}

// Checks the TLS files. The messages do not reveal their content.
absl::Status CheckTls(const TlsOptions& options) {
  if (options.certificate.empty() || options.key.empty() ||
      options.client_ca.empty()) {
    return absl::InvalidArgumentError(
        "a TCP address needs tls-certificate, tls-key and tls-client-ca; "
        "without encryption and authentication it must be explicit: "
        "insecure:host:port");
  }
  const std::unique_ptr<SSL_CTX, void (*)(SSL_CTX*)> context(
      SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  if (context == nullptr) {
    return absl::InternalError("OpenSSL cannot be initialised");
  }
  SSL_CTX_set_default_passwd_cb(context.get(), NoPassphrase);
  ERR_clear_error();
  if (SSL_CTX_use_certificate_chain_file(context.get(),
                                         options.certificate.c_str()) != 1) {
    return Unusable("certificate", options.certificate);
  }
  if (SSL_CTX_use_PrivateKey_file(
          context.get(), options.key.c_str(), SSL_FILETYPE_PEM) != 1) {
    return Unusable("key", options.key);
  }
  if (SSL_CTX_load_verify_file(context.get(), options.client_ca.c_str()) != 1) {
    return Unusable("client authority", options.client_ca);
  }
  return absl::OkStatus();
}

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
    const TlsOptions& options) {
  namespace tls = grpc::experimental;
  tls::TlsServerCredentialsOptions credentials(
      std::make_shared<tls::FileWatcherCertificateProvider>(
          options.key,
          options.certificate,
          options.client_ca,
          static_cast<unsigned>(options.refresh_s)));
  credentials.watch_root_certs();
  credentials.watch_identity_key_cert_pairs();
  credentials.set_cert_request_type(
      GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  return tls::TlsServerCredentials(credentials);
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
    if (absl::Status checked = CheckTls(options.tls); !checked.ok()) {
      return checked;
    }
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
