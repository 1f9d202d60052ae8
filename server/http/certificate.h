// The caller of a TLS connection.
#pragma once

#include <absl/status/statusor.h>
#include <gnutls/gnutls.h>

#include "server/access/grants.h"

namespace selfcal::server {

// Returns the caller, with the rights that its certificate states.
// UNAUTHENTICATED without a certificate, or if the client authority did not
// sign it for clients.
absl::StatusOr<Caller> CallerOf(gnutls_session_t session);

}  // namespace selfcal::server
