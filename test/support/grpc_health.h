// Messages of gRPC by hand: Debian packages no C++ code for those of health and
// reflection.
#pragma once

#include <grpcpp/grpcpp.h>
#include <grpcpp/impl/codegen/client_unary_call.h>

#include <memory>
#include <string>
#include <vector>

namespace selfcal {

inline grpc::ByteBuffer Buffer(const std::string& bytes) {
  const grpc::Slice slice(bytes);
  return grpc::ByteBuffer(&slice, 1);
}

inline std::string Bytes(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  buffer.Dump(&slices);
  std::string bytes;
  for (const grpc::Slice& slice : slices) {
    bytes.append(slice.begin(), slice.end());
  }
  return bytes;
}

// A field of a message. Texts are shorter than 128 bytes.
inline std::string TextField(int number, const std::string& text) {
  return std::string(1, static_cast<char>(number << 3 | 2)) +
         static_cast<char>(text.size()) + text;
}

inline const std::string kServing = {'\x08', '\x01'};
inline const std::string kNotServing = {'\x08', '\x02'};

// The health of a service, or of the whole server if it is empty: one of the
// two, or the error code.
inline std::string HealthOf(grpc::Channel* channel,
                            const std::string& service) {
  grpc::ClientContext context;
  const grpc::internal::RpcMethod method("/grpc.health.v1.Health/Check",
                                         grpc::internal::RpcMethod::NORMAL_RPC);
  grpc::ByteBuffer response;
  const grpc::Status status = grpc::internal::BlockingUnaryCall(
      channel,
      method,
      &context,
      Buffer(service.empty() ? "" : TextField(1, service)),
      &response);
  if (!status.ok()) return std::to_string(status.error_code());
  return Bytes(response);
}

}  // namespace selfcal
