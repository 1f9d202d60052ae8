// The caller of an RPC, and its authorisation.
#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/status.h>

#include <string>

#include "server/access/grants.h"
#include "server/service/errors.h"
#include "server/service/services.h"

namespace selfcal::server {

// The name of the caller for the event log: the common name of the client's
// certificate or, without one, the kind of connection, e.g. "local". Printable
// ASCII, not empty.
std::string CallerName(const grpc::ServerContextBase& call);

// Returns the caller with the rights that its certificate states; without a
// certificate, with the role `local` on every rig.
Caller CallerOf(const grpc::ServerContextBase& call, Role local);

// OK, or PERMISSION_DENIED (server/access/rules.h).
grpc::Status Authorise(const grpc::ServerContextBase& call,
                       Role local,
                       const google::protobuf::Message& request);

// Runs the handler if the caller is authorised; no exception leaves it.
template <typename Handler>
grpc::Status Authorised(const ServiceContext& context,
                        const grpc::ServerContextBase& call,
                        const google::protobuf::Message& request,
                        const Handler& handler) {
  return Guarded([&]() -> grpc::Status {
    const auto may = Authorise(call, context.local_role, request);
    return may.ok() ? handler() : may;
  });
}

}  // namespace selfcal::server
