#include "server/console/tls_files.h"

#include <gnutls/gnutls.h>

#include <fstream>
#include <iterator>

namespace selfcal::server {
namespace {

gnutls_datum_t Datum(std::string* text) {
  return {reinterpret_cast<unsigned char*>(text->data()),
          static_cast<unsigned>(text->size())};
}

std::string Read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

absl::Status Check(TlsFiles* files, const TlsOptions& options) {
  gnutls_certificate_credentials_t credentials = nullptr;
  if (gnutls_certificate_allocate_credentials(&credentials) != 0) {
    return absl::ResourceExhaustedError("GnuTLS cannot be initialised");
  }
  gnutls_datum_t certificate = Datum(&files->certificate);
  gnutls_datum_t key = Datum(&files->key);
  gnutls_datum_t authority = Datum(&files->client_ca);
  const int paired = gnutls_certificate_set_x509_key_mem(
      credentials, &certificate, &key, GNUTLS_X509_FMT_PEM);
  const int trusted = gnutls_certificate_set_x509_trust_mem(
      credentials, &authority, GNUTLS_X509_FMT_PEM);
  gnutls_certificate_free_credentials(credentials);
  if (paired < 0) {
    return absl::FailedPreconditionError(
        "the console cannot use " + options.certificate + " with " +
        options.key + ": " + gnutls_strerror(paired));
  }
  if (trusted <= 0) {
    return absl::FailedPreconditionError(
        "the console found no certificate of an authority in " +
        options.client_ca);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<TlsFiles> ReadTlsFiles(const TlsOptions& options) {
  if (options.certificate.empty() || options.key.empty() ||
      options.client_ca.empty()) {
    return absl::InvalidArgumentError(
        "on an address that is not loopback, the console needs "
        "tls-certificate, "
        "tls-key and tls-client-ca; or use a loopback address such as "
        "127.0.0.1:7448");
  }
  TlsFiles files{
      Read(options.certificate), Read(options.key), Read(options.client_ca)};
  if (absl::Status checked = Check(&files, options); !checked.ok()) {
    return checked;
  }
  return files;
}

}  // namespace selfcal::server
