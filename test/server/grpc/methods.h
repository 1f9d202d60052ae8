// Calls any method of the contract by its descriptor.
#pragma once

#include <grpcpp/grpcpp.h>
#include <grpcpp/impl/codegen/sync_stream.h>

#include <memory>
#include <string>
#include <vector>

#include "test/server/access/contract.h"

namespace selfcal::server {

// Sends one request and reads what comes until the end, but not longer than
// the deadline: a watch goes on for ever. On the wire a unary call is a stream.
// *responses, if given, gets what was read, encoded.
inline grpc::Status CallWith(const std::shared_ptr<grpc::Channel>& channel,
                             const MethodDescriptor& method,
                             const google::protobuf::Message& request,
                             std::chrono::milliseconds deadline,
                             std::vector<std::string>* responses = nullptr) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + deadline);
  const std::string path =
      "/" + method.service()->full_name() + "/" + method.name();
  const grpc::internal::RpcMethod rpc(
      path.c_str(), grpc::internal::RpcMethod::BIDI_STREAMING);
  const std::unique_ptr<
      grpc::ClientReaderWriter<grpc::ByteBuffer, grpc::ByteBuffer>>
      stream(grpc::internal::ClientReaderWriterFactory<
             grpc::ByteBuffer,
             grpc::ByteBuffer>::Create(channel.get(), rpc, &context));
  const grpc::Slice slice(request.SerializeAsString());
  stream->Write(grpc::ByteBuffer(&slice, 1));
  stream->WritesDone();
  grpc::ByteBuffer response;
  while (stream->Read(&response)) {
    if (responses == nullptr) continue;
    grpc::Slice whole;
    if (response.DumpToSingleSlice(&whole).ok()) {
      responses->emplace_back(whole.begin(), whole.end());
    }
  }
  return stream->Finish();
}

}  // namespace selfcal::server
