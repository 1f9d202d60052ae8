// Processes the segments of one StreamSegments call.
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
  // The verdict on one segment, or the error that ends the stream: the rig of
  // the first message does not exist, or the store fails.
  struct Answer {
    grpc::Status status;
    v1::StreamSegmentsResponse response;
  };
  using Done = std::function<void(Answer answer)>;

  // `cancelled` returns true if the caller has disconnected.
  SegmentStream(const ServiceContext& context, std::function<bool()> cancelled);
  // Reports the end of a session if the stream has stored a segment, unless the
  // daemon is stopping.
  ~SegmentStream();
  SegmentStream(const SegmentStream&) = delete;
  SegmentStream& operator=(const SegmentStream&) = delete;

  // Processes one request; only one thread may call. Waits while the queue of
  // the daemon is full, but not for the disk. Unless this throws, `done` is
  // called once: on this thread, or on another that must not be blocked.
  void Take(const v1::StreamSegmentsRequest& request, const Done& done);

 private:
  grpc::Status Open(const std::string& parent);
  bool stopped() const;
  // Counts the verdict, then reports it.
  void Answered(v1::StreamSegmentsResponse response, const Done& done);

  ServiceContext context_;
  std::function<bool()> cancelled_;
  std::string parent_;  // empty before the first message
  std::string rig_;
  std::atomic<bool> stored_ = false;  // a segment was stored
};

}  // namespace selfcal::server
