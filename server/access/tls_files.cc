#include "server/access/tls_files.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <ctime>
#include <fstream>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

template <auto free>
struct Free {
  template <typename T>
  void operator()(T* object) const {
    free(object);
  }
};
using Bio = std::unique_ptr<BIO, Free<BIO_free>>;
using Certificate = std::unique_ptr<X509, Free<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>>;

absl::Status Unusable(const std::string& what,
                      const std::string& path,
                      const std::string& reason) {
  return absl::FailedPreconditionError(
      fmt::format("cannot use the {} {}: {}", what, path, reason));
}

// The message of OpenSSL for the last failure, which never quotes the file.
std::string Reason() {
  const char* reason = ERR_reason_error_string(ERR_get_error());
  ERR_clear_error();
  return reason == nullptr ? "it is not a PEM file" : reason;
}

// Prevents OpenSSL from prompting at the terminal for an encrypted key.
int NoPassphrase(char*, int, int, void*) { return 0; }

absl::StatusOr<std::string> Read(const std::string& what,
                                 const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file) return Unusable(what, path, "it cannot be read");
  return text;
}

// All certificates of the text, at least one.
absl::StatusOr<std::vector<Certificate>> Parse(const std::string& what,
                                               const std::string& path,
                                               const std::string& text) {
  const Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  std::vector<Certificate> parsed;
  ERR_clear_error();
  for (;;) {
    Certificate next(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
    if (next == nullptr) break;
    parsed.push_back(std::move(next));
  }
  const bool at_end =
      ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  if (!at_end || parsed.empty()) return Unusable(what, path, Reason());
  ERR_clear_error();
  return parsed;
}

std::int64_t SecondsOf(const ASN1_TIME* time) {
  std::tm parts{};
  return ASN1_TIME_to_tm(time, &parts) == 1 ? timegm(&parts) : 0;
}

std::string DateOf(std::int64_t time_s) {
  return fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(time_s));
}

absl::Status CheckValidity(const X509* certificate,
                           const std::string& path,
                           std::int64_t now_s) {
  const std::int64_t begin_s = SecondsOf(X509_get0_notBefore(certificate));
  const std::int64_t end_s = SecondsOf(X509_get0_notAfter(certificate));
  if (now_s >= end_s) {
    return Unusable(
        "certificate", path, "it expired on " + DateOf(end_s) + "; renew it");
  }
  if (now_s < begin_s) {
    return Unusable("certificate",
                    path,
                    "it is valid from " + DateOf(begin_s) +
                        " on; look at the clock of this machine");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<TlsFiles> ReadTlsFiles(const TlsOptions& options,
                                      std::int64_t now_s) {
  if (options.certificate.empty() || options.key.empty() ||
      options.client_ca.empty()) {
    return absl::InvalidArgumentError(
        "TLS needs tls-certificate, tls-key and tls-client-ca");
  }
  TlsFiles files;
  SELFCAL_ASSIGN_OR_RETURN(files.certificate,
                           Read("certificate", options.certificate));
  SELFCAL_ASSIGN_OR_RETURN(files.key, Read("key", options.key));
  SELFCAL_ASSIGN_OR_RETURN(files.client_ca,
                           Read("client authority", options.client_ca));
  SELFCAL_ASSIGN_OR_RETURN(
      const auto chain,
      Parse("certificate", options.certificate, files.certificate));
  SELFCAL_RETURN_IF_ERROR(
      Parse("client authority", options.client_ca, files.client_ca).status());
  const Bio bio(
      BIO_new_mem_buf(files.key.data(), static_cast<int>(files.key.size())));
  const Key key(
      PEM_read_bio_PrivateKey(bio.get(), nullptr, NoPassphrase, nullptr));
  if (key == nullptr) return Unusable("key", options.key, Reason());
  X509* const certificate = chain.front().get();
  if (X509_check_private_key(certificate, key.get()) != 1) {
    ERR_clear_error();
    return Unusable(
        "key", options.key, "it is not that of " + options.certificate);
  }
  SELFCAL_RETURN_IF_ERROR(
      CheckValidity(certificate, options.certificate, now_s));
  files.expiry_s = SecondsOf(X509_get0_notAfter(certificate));
  return files;
}

}  // namespace selfcal::server
