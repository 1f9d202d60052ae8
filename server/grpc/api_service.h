// A service of the contract over gRPC, made from its descriptor and the methods
// of the API. Internal to server/grpc.
#pragma once

#include <google/protobuf/descriptor.h>
#include <grpcpp/impl/codegen/service_type.h>

#include <memory>

#include "server/grpc/calls.h"

namespace selfcal::server {

// The API of the context outlives it.
std::unique_ptr<grpc::Service> MakeApiService(
    const google::protobuf::ServiceDescriptor& service,
    const CallContext& context);

}  // namespace selfcal::server
