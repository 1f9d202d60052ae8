// Messages as gRPC carries them, for calls whose types are known at run time.
// Internal to server/grpc.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>
#include <grpcpp/support/byte_buffer.h>

#include <memory>

#include "server/api/watch_update.h"

namespace selfcal::server {

// INVALID_ARGUMENT for bytes that are no such message.
absl::Status Parse(const grpc::ByteBuffer& bytes,
                   google::protobuf::Message* message);

grpc::ByteBuffer Serialise(const google::protobuf::Message& message);
// Without a copy: the result shares the bytes of the update.
grpc::ByteBuffer Serialise(std::shared_ptr<const WatchUpdate> update);

}  // namespace selfcal::server
