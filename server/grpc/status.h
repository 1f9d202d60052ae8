// Statuses of gRPC. Internal to server/grpc.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/status.h>

namespace selfcal::server {

// With the details of server/api/errors.h as google.rpc.Status in the trailer.
grpc::Status ToGrpc(const absl::Status& status);

}  // namespace selfcal::server
