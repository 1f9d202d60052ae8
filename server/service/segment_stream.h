// The state of one StreamSegments call. Used by one thread.
#pragma once

#include <grpcpp/support/status.h>

#include <functional>
#include <string>

#include "selfcal/v1/segment.pb.h"
#include "server/service/services.h"

namespace selfcal::server {

class SegmentStream {
 public:
  // `cancelled` tells whether the caller has gone.
  SegmentStream(const ServiceContext& context, std::function<bool()> cancelled);

  // Takes one request and fills the verdict on it. An error ends the stream:
  // the first message does not name a rig that exists, or the store fails.
  grpc::Status Take(const v1::StreamSegmentsRequest& request,
                    v1::StreamSegmentsResponse* response);

 private:
  grpc::Status Open(const std::string& parent);
  bool stopped() const;

  ServiceContext context_;
  std::function<bool()> cancelled_;
  std::string parent_;  // empty until the first message
  std::string rig_;
};

}  // namespace selfcal::server
