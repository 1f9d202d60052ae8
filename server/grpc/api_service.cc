#include "server/grpc/api_service.h"

#include <grpcpp/impl/codegen/rpc_service_method.h>
#include <grpcpp/impl/codegen/server_callback_handlers.h>
#include <grpcpp/impl/codegen/service_type.h>

#include <deque>
#include <string>
#include <type_traits>
#include <variant>

namespace selfcal::server {
namespace {

using Bytes = grpc::ByteBuffer;
using grpc::internal::RpcMethod;

// Registers its methods as code that protoc generates does, but with bytes in
// place of messages, so that one class serves every method.
class ApiService final : public grpc::Service {
 public:
  ApiService(const google::protobuf::ServiceDescriptor& service,
             const CallContext& context)
      : context_(context) {
    for (const Method& method : context.api->methods()) {
      if (method.descriptor->service() == &service) Register(method);
    }
  }

 private:
  void Register(const Method& method) {
    const std::string& name =
        names_.emplace_back("/" + method.descriptor->service()->full_name() +
                            "/" + method.descriptor->name());
    const int index = static_cast<int>(names_.size()) - 1;
    const auto add = [&](RpcMethod::RpcType type,
                         grpc::internal::MethodHandler* handler) {
      AddMethod(
          new grpc::internal::RpcServiceMethod(name.c_str(), type, nullptr));
      MarkMethodRawCallback(index, handler);
    };
    if (std::holds_alternative<UnaryHandler>(method.handler)) {
      add(RpcMethod::NORMAL_RPC,
          new grpc::internal::CallbackUnaryHandler<Bytes, Bytes>(
              [this, &method](Rpc* rpc, const Bytes* request, Bytes* response) {
                return StartUnary(context_, method, rpc, request, response);
              }));
    } else if (std::holds_alternative<StreamingHandler>(method.handler)) {
      add(RpcMethod::SERVER_STREAMING,
          new grpc::internal::CallbackServerStreamingHandler<Bytes, Bytes>(
              [this, &method](Rpc* rpc, const Bytes* request) {
                return StartStreaming(context_, method, rpc, request);
              }));
    } else if (std::holds_alternative<WatchHandler>(method.handler)) {
      add(RpcMethod::SERVER_STREAMING,
          new grpc::internal::CallbackServerStreamingHandler<Bytes, Bytes>(
              [this, &method](Rpc* rpc, const Bytes* request) {
                return StartWatch(context_, method, rpc, request);
              }));
    } else if (std::holds_alternative<UploadHandler>(method.handler)) {
      add(RpcMethod::CLIENT_STREAMING,
          new grpc::internal::CallbackClientStreamingHandler<Bytes, Bytes>(
              [this, &method](Rpc* rpc, Bytes* response) {
                return StartUpload(context_, method, rpc, response);
              }));
    } else {
      add(RpcMethod::BIDI_STREAMING,
          new grpc::internal::CallbackBidiHandler<Bytes, Bytes>(
              [this, &method](Rpc* rpc) {
                return StartExchange(context_, method, rpc);
              }));
    }
  }

  const CallContext context_;
  std::deque<std::string> names_;  // gRPC keeps pointers to them
};

}  // namespace

std::unique_ptr<grpc::Service> MakeApiService(
    const google::protobuf::ServiceDescriptor& service,
    const CallContext& context) {
  return std::make_unique<ApiService>(service, context);
}

}  // namespace selfcal::server
