// The six services of the contract, each in a file of its own: decode the
// request, authorise it, ask the store or the pipeline, encode the answer.
// Nothing that comes from the network aborts or throws out of a handler.
//
// Every call runs on a thread of the gRPC server; a watch holds one as long as
// it lives, a stream of segments has one of its own.
#pragma once

#include <grpcpp/impl/codegen/service_type.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>

#include "server/access/grants.h"
#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"

namespace selfcal::server {

class Traffic;  // traffic.h

// All of it outlives the services.
struct ServiceContext {
  Domain* domain = nullptr;
  Store* store = nullptr;  // of `domain`
  Pipeline* pipeline = nullptr;
  // Once true, watches and streams end with UNAVAILABLE.
  const std::atomic<bool>* stopping = nullptr;
  // Of callers without a certificate.
  Role local_role = Role::kAdminister;
  std::int64_t max_rigs = 0;
  int max_segment_streams = 256;  // at once
  // Called when a restored database waits for the next start; or nothing.
  std::function<void()> restored;
  Traffic* traffic = nullptr;  // of segments, counted for ActivityService
};

std::unique_ptr<grpc::Service> MakeRigService(const ServiceContext& context);
std::unique_ptr<grpc::Service> MakeSegmentService(
    const ServiceContext& context);
std::unique_ptr<grpc::Service> MakeCalibrationService(
    const ServiceContext& context);
std::unique_ptr<grpc::Service> MakeRecalibrationService(
    const ServiceContext& context);
std::unique_ptr<grpc::Service> MakeStoreService(const ServiceContext& context);
std::unique_ptr<grpc::Service> MakeActivityService(
    const ServiceContext& context);

}  // namespace selfcal::server
