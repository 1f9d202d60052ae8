// The six services of the contract, each in its own file. A handler decodes the
// request, authorises it, calls the store or the pipeline, and encodes the
// response. Input from the network never aborts the process, and no exception
// leaves a handler.
//
// Every call runs on a thread of the gRPC server; a watch occupies it as long
// as it lives, a stream of segments has its own thread.
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

// The pointers must outlive the services.
struct ServiceContext {
  Domain* domain = nullptr;
  Store* store = nullptr;  // of `domain`
  Pipeline* pipeline = nullptr;
  // Once true, watches and streams end with UNAVAILABLE.
  const std::atomic<bool>* stopping = nullptr;
  // Role of callers without a certificate.
  Role local_role = Role::kAdminister;
  std::int64_t max_rigs = 0;
  int max_segment_streams = 256;  // concurrent streams
  // Called when a restored database is ready for the next start; may be empty.
  std::function<void()> restored;
  Traffic* traffic = nullptr;  // counts segments for ActivityService
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
