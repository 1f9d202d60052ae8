// One StreamSegments call: reads ahead while there is room, and answers in
// order.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>

#include "selfcal/v1/segment.pb.h"
#include "server/service/services.h"

namespace selfcal::server {

// Segments of one stream that are read and not yet answered: enough to fill a
// commit while another is on its way to the disk.
inline constexpr int kReadAhead = 4;

using SegmentReactor = grpc::ServerBidiReactor<v1::StreamSegmentsRequest,
                                               v1::StreamSegmentsResponse>;

// Takes the call; the reactor lives until it has ended, on a thread of its own.
// RESOURCE_EXHAUSTED if `open_calls` is at the limit of the context already.
SegmentReactor* StartSegmentCall(const ServiceContext& context,
                                 const grpc::CallbackServerContext* call,
                                 std::atomic<int>* open_calls);

}  // namespace selfcal::server
