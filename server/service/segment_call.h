// One StreamSegments call: reads ahead within a limit, and responds in order.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>

#include "selfcal/v1/segment.pb.h"
#include "server/service/services.h"

namespace selfcal::server {

// Limit on the segments of one stream that are read and not yet answered:
// enough to fill a commit while another is being written to disk.
inline constexpr int kReadAhead = 4;

using SegmentReactor = grpc::ServerBidiReactor<v1::StreamSegmentsRequest,
                                               v1::StreamSegmentsResponse>;

// Starts to handle the call, on a thread of its own; the reactor lives until
// the call has ended. RESOURCE_EXHAUSTED if `open_calls` is at the limit of the
// context.
SegmentReactor* StartSegmentCall(const ServiceContext& context,
                                 const grpc::CallbackServerContext* call,
                                 std::atomic<int>* open_calls);

}  // namespace selfcal::server
