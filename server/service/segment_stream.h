// What happens to the segments of one StreamSegments call.
#pragma once

#include <grpcpp/support/status.h>

#include <atomic>
#include <functional>
#include <string>

#include "selfcal/v1/segment.pb.h"
#include "server/service/services.h"

namespace selfcal::server {

class SegmentStream {
 public:
  // The verdict on one segment, or the error that ends the stream: the first
  // message does not name a rig that exists, or the store fails.
  struct Answer {
    grpc::Status status;
    v1::StreamSegmentsResponse response;
  };
  using Done = std::function<void(Answer answer)>;

  // `cancelled` tells whether the caller has gone.
  SegmentStream(const ServiceContext& context, std::function<bool()> cancelled);
  // The end of a stream that has stored something is the end of a session,
  // unless the daemon stops.
  ~SegmentStream();
  SegmentStream(const SegmentStream&) = delete;
  SegmentStream& operator=(const SegmentStream&) = delete;

  // Takes one request; one thread calls. Waits while the daemon is behind, but
  // not for the disk. `done` is called once unless this throws: on this thread,
  // or on another that must not be held up.
  void Take(const v1::StreamSegmentsRequest& request, const Done& done);

 private:
  grpc::Status Open(const std::string& parent);
  bool stopped() const;
  // Counts the verdict, then tells it.
  void Answered(v1::StreamSegmentsResponse response, const Done& done);

  ServiceContext context_;
  std::function<bool()> cancelled_;
  std::string parent_;  // empty until the first message
  std::string rig_;
  std::atomic<bool> stored_ = false;  // anything
};

}  // namespace selfcal::server
