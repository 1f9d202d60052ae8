// Calls of gRPC, one class for each form of method (server/api/method.h): they
// parse requests, run the handler and send responses. Internal to server/grpc.
//
// Each function starts the handling of a call. The reactor that it returns
// belongs to gRPC and lives until the call has ended. What a call uses must
// outlive it.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <chrono>
#include <cstdint>

#include "server/access/grants.h"
#include "server/api/api.h"
#include "server/grpc/call_threads.h"
#include "server/grpc/memory_pool.h"
#include "server/grpc/read_gate.h"

namespace selfcal::server {

class WatchSender;  // watch_sender.h

struct CallContext {
  const Api* api = nullptr;
  Role local_role = Role::kAdminister;  // of callers without a certificate
  CallThreads* threads = nullptr;
  ReadGate* reads = nullptr;
  MemoryPool* work = nullptr;  // for what requests become
  std::int64_t max_request_bytes = 0;
  WatchSender* watches = nullptr;
  std::chrono::milliseconds max_write_time{60'000};  // of one response
  int max_exchanges = 256;                           // at once
  std::atomic<int>* exchanges = nullptr;
};

// Limit on the requests of one exchange that are read and not yet answered:
// enough to fill a commit while another is being written to disk.
inline constexpr int kReadAhead = 4;

using Rpc = grpc::CallbackServerContext;

// RESOURCE_EXHAUSTED if no thread is free; as for the next two.
grpc::ServerUnaryReactor* StartUnary(const CallContext& context,
                                     const Method& method,
                                     Rpc* rpc,
                                     const grpc::ByteBuffer* request,
                                     grpc::ByteBuffer* response);

// Cancels the call if the caller does not read a response for max_write_time:
// the thread, and what the handler holds, are for others too.
grpc::ServerWriteReactor<grpc::ByteBuffer>* StartStreaming(
    const CallContext& context,
    const Method& method,
    Rpc* rpc,
    const grpc::ByteBuffer* request);

grpc::ServerReadReactor<grpc::ByteBuffer>* StartUpload(
    const CallContext& context,
    const Method& method,
    Rpc* rpc,
    grpc::ByteBuffer* response);

// Occupies a thread only until it stands. RESOURCE_EXHAUSTED at the limit of
// watches.
grpc::ServerWriteReactor<grpc::ByteBuffer>* StartWatch(
    const CallContext& context,
    const Method& method,
    Rpc* rpc,
    const grpc::ByteBuffer* request);

// On a thread of its own: reads ahead within a limit, and responds in order.
// RESOURCE_EXHAUSTED at the limit of the context.
grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* StartExchange(
    const CallContext& context, const Method& method, Rpc* rpc);

// The error of a call for which no thread is free.
absl::Status TooManyCalls();

}  // namespace selfcal::server
