#include "server/http/certificate.h"

#include <gnutls/x509.h>

#include <array>
#include <memory>
#include <string>
#include <type_traits>

namespace selfcal::server {
namespace {

constexpr std::size_t kMaxText = 1024;

struct Release {
  void operator()(gnutls_x509_crt_t certificate) const {
    gnutls_x509_crt_deinit(certificate);
  }
};
using Certificate =
    std::unique_ptr<std::remove_pointer_t<gnutls_x509_crt_t>, Release>;

absl::Status Unknown() {
  return absl::UnauthenticatedError(
      "this address needs a client certificate; import one that the "
      "operator's client authority signed into the browser");
}

bool IsTrusted(gnutls_session_t session) {
  std::string purpose = GNUTLS_KP_TLS_WWW_CLIENT;
  gnutls_typed_vdata_st wanted{};
  wanted.type = GNUTLS_DT_KEY_PURPOSE_OID;
  wanted.data = reinterpret_cast<unsigned char*>(purpose.data());
  unsigned problems = 1;
  return gnutls_certificate_verify_peers(session, &wanted, 1, &problems) ==
             GNUTLS_E_SUCCESS &&
         problems == 0;
}

// Returns the certificate of the peer; null if there is none or it is invalid.
Certificate PeerCertificate(gnutls_session_t session) {
  unsigned count = 0;
  const gnutls_datum_t* chain = gnutls_certificate_get_peers(session, &count);
  gnutls_x509_crt_t raw = nullptr;
  if (chain == nullptr || count == 0 || gnutls_x509_crt_init(&raw) != 0) {
    return nullptr;
  }
  Certificate certificate(raw);
  if (gnutls_x509_crt_import(raw, &chain[0], GNUTLS_X509_FMT_DER) != 0) {
    return nullptr;
  }
  return certificate;
}

std::string CommonName(gnutls_x509_crt_t certificate) {
  std::array<char, kMaxText> name{};
  std::size_t size = name.size();
  const int found = gnutls_x509_crt_get_dn_by_oid(
      certificate, GNUTLS_OID_X520_COMMON_NAME, 0, 0, name.data(), &size);
  if (found != 0 || size == 0) return "unnamed certificate";
  return PrintableName(std::string(name.data(), size));
}

std::vector<Grant> GrantsOf(gnutls_x509_crt_t certificate) {
  std::vector<Grant> grants;
  for (unsigned i = 0;; ++i) {
    std::array<char, kMaxText> name{};
    std::size_t size = name.size();
    const int type = gnutls_x509_crt_get_subject_alt_name(
        certificate, i, name.data(), &size, nullptr);
    if (type == GNUTLS_E_SHORT_MEMORY_BUFFER) continue;  // too long for a grant
    if (type < 0) return grants;
    if (type != GNUTLS_SAN_URI) continue;
    const auto grant = ParseGrant(std::string_view(name.data(), size));
    if (grant) grants.push_back(*grant);
  }
}

}  // namespace

absl::StatusOr<Caller> CallerOf(gnutls_session_t session) {
  if (!IsTrusted(session)) return Unknown();
  const Certificate certificate = PeerCertificate(session);
  if (certificate == nullptr) return Unknown();
  return Caller{CommonName(certificate.get()), GrantsOf(certificate.get())};
}

}  // namespace selfcal::server
