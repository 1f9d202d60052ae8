// The caller of a gRPC call. Internal to server/grpc.
#pragma once

#include <grpcpp/server_context.h>

#include "server/access/grants.h"

namespace selfcal::server {

// The caller with its name for the event log (the common name of its
// certificate, or how it connected without one, e.g. "local") and the rights
// that the certificate states. Without a certificate: `local` on every rig.
Caller CallerOf(const grpc::ServerContextBase& call, Role local);

}  // namespace selfcal::server
