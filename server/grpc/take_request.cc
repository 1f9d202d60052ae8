#include "server/grpc/take_request.h"

#include <fmt/format.h>
#include <grpcpp/support/proto_buffer_reader.h>

#include <algorithm>
#include <cstdint>
#include <new>
#include <optional>

#include "proto/parsed_size.h"
#include "server/api/errors.h"
#include "server/grpc/bytes.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// Bytes that a request needs, for each of its own, while it is parsed,
// converted, and packed to be stored.
constexpr std::int64_t kWorkPerByte = 4;

std::int64_t ParsedSizeOf(const grpc::ByteBuffer& bytes,
                          const google::protobuf::Message& type) {
  grpc::ByteBuffer copy = bytes;  // shares the bytes
  grpc::ProtoBufferReader reader(&copy);
  return ParsedSize(*type.GetDescriptor(), &reader);
}

absl::Status CheckSize(const CallContext& context,
                       const grpc::ByteBuffer& bytes,
                       std::int64_t parsed) {
  if (parsed <= kWorkPerByte * context.max_request_bytes) {
    return absl::OkStatus();
  }
  return ForClient(absl::ResourceExhaustedError(fmt::format(
      "the request has {} bytes, but {} MiB of elements: send fewer of them",
      bytes.Length(),
      parsed >> 20)));
}

}  // namespace

absl::StatusOr<MemoryPool::Share> TakeRequest(
    const CallContext& context,
    const grpc::ByteBuffer& bytes,
    const std::function<bool()>& cancelled,
    google::protobuf::Message* request,
    const std::function<std::int64_t(const google::protobuf::Message&)>& more) {
  const std::int64_t parsed = ParsedSizeOf(bytes, *request);
  SELFCAL_RETURN_IF_ERROR(CheckSize(context, bytes, parsed));
  const std::int64_t own = std::max(
      kWorkPerByte * static_cast<std::int64_t>(bytes.Length()), parsed);
  std::optional<MemoryPool::Share> work = context.work->Acquire(own, cancelled);
  if (!work) return absl::CancelledError("the caller has gone");
  try {
    SELFCAL_RETURN_IF_ERROR(Parse(bytes, request));
    if (more) {
      const std::int64_t made = more(*request);
      SELFCAL_RETURN_IF_ERROR(CheckSize(context, bytes, made));
      // Returned first: two that wait for more would wait for each other.
      work.reset();
      work = context.work->Acquire(own + made, cancelled, true);
      if (!work) return absl::CancelledError("the caller has gone");
    }
  } catch (const std::bad_alloc&) {
    return ForClient(
        absl::ResourceExhaustedError("memory is short: try again later"));
  }
  return *std::move(work);
}

}  // namespace selfcal::server
