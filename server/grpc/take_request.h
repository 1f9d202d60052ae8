// A request as gRPC carries it becomes a message, within the memory for that.
// Internal to server/grpc.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/message.h>
#include <grpcpp/support/byte_buffer.h>

#include <cstdint>
#include <functional>

#include "server/grpc/calls.h"
#include "server/grpc/memory_pool.h"

namespace selfcal::server {

// Parses the bytes, and returns the share of the work memory that the message
// and what is made of it take: hold it as long as they exist. It waits until
// there is room. `more` returns further bytes that are made of the message
// (Method::work). INVALID_ARGUMENT for bytes that are no such message,
// RESOURCE_EXHAUSTED for a message that would take more than a request may,
// CANCELLED once `cancelled` returns true.
absl::StatusOr<MemoryPool::Share> TakeRequest(
    const CallContext& context,
    const grpc::ByteBuffer& bytes,
    const std::function<bool()>& cancelled,
    google::protobuf::Message* request,
    const std::function<std::int64_t(const google::protobuf::Message&)>& more =
        nullptr);

}  // namespace selfcal::server
