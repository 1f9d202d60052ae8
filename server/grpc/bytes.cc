#include "server/grpc/bytes.h"

#include <grpcpp/support/proto_buffer_reader.h>
#include <grpcpp/support/proto_buffer_writer.h>

#include <algorithm>
#include <string>
#include <utility>

namespace selfcal::server {

absl::Status Parse(const grpc::ByteBuffer& bytes,
                   google::protobuf::Message* message) {
  grpc::ByteBuffer copy = bytes;  // shares the bytes
  grpc::ProtoBufferReader reader(&copy);
  if (reader.status().ok() && message->ParseFromZeroCopyStream(&reader)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError("the request is not a message of type " +
                                    message->GetTypeName());
}

grpc::ByteBuffer Serialise(const google::protobuf::Message& message) {
  constexpr int kBlockBytes = 1 << 20;
  const int size = static_cast<int>(message.ByteSizeLong());
  grpc::ByteBuffer bytes;
  grpc::ProtoBufferWriter writer(
      &bytes, std::clamp(size, 1, kBlockBytes), size);
  message.SerializeToZeroCopyStream(&writer);
  return bytes;
}

grpc::ByteBuffer Serialise(std::shared_ptr<const WatchUpdate> update) {
  using Held = std::shared_ptr<const WatchUpdate>;
  const std::string& bytes = update->bytes();
  // gRPC does not write to what it is given, but takes it as void*.
  const grpc::Slice slice(
      const_cast<char*>(bytes.data()),
      bytes.size(),
      [](void* held) { delete static_cast<Held*>(held); },
      new Held(std::move(update)));
  return {&slice, 1};
}

}  // namespace selfcal::server
