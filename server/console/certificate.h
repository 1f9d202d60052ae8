// Who is at the other end of a TLS connection.
#pragma once

#include <absl/status/statusor.h>
#include <gnutls/gnutls.h>

#include "server/access/grants.h"

namespace selfcal::server {

// With the rights that its certificate states. UNAUTHENTICATED without a
// certificate, or for one that the client authority did not sign for clients.
absl::StatusOr<Caller> CallerOf(gnutls_session_t session);

}  // namespace selfcal::server
