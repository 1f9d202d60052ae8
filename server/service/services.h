// The four services of the contract, each in a file of its own: decode the
// request, authorise it, ask the store or the pipeline, encode the answer.
// Nothing that comes from the network aborts or throws out of a handler.
//
// Every call runs on a thread of the gRPC server; a stream or a watch holds one
// as long as it lives.
#pragma once

#include <grpcpp/impl/codegen/service_type.h>

#include <atomic>
#include <cstdint>
#include <memory>

#include "server/access/grants.h"
#include "server/pipeline/pipeline.h"
#include "server/store/store.h"

namespace selfcal::server {

// All of it outlives the services.
struct ServiceContext {
  Store* store = nullptr;
  Pipeline* pipeline = nullptr;
  // Once true, watches and streams end with UNAVAILABLE.
  const std::atomic<bool>* stopping = nullptr;
  // Of callers without a certificate.
  Role local_role = Role::kAdminister;
  std::int64_t max_rigs = 0;
};

std::unique_ptr<grpc::Service> MakeRigService(const ServiceContext& context);
std::unique_ptr<grpc::Service> MakeSegmentService(
    const ServiceContext& context);
std::unique_ptr<grpc::Service> MakeCalibrationService(
    const ServiceContext& context);
std::unique_ptr<grpc::Service> MakeRecalibrationService(
    const ServiceContext& context);

}  // namespace selfcal::server
