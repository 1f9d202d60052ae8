#include "server/grpc/status.h"

#include "server/api/errors.h"

namespace selfcal::server {

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const google::rpc::Status message = ToMessage(status);
  // absl and gRPC number the canonical codes alike.
  const auto code = static_cast<grpc::StatusCode>(message.code());
  return message.details_size() == 0
             ? grpc::Status(code, message.message())
             : grpc::Status(
                   code, message.message(), message.SerializeAsString());
}

}  // namespace selfcal::server
