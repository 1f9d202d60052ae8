// The loop of a watch: from a mailbox to the stream of its reader.
#pragma once

#include <grpcpp/server_context.h>

#include <chrono>

#include "server/service/errors.h"
#include "server/service/mailbox.h"
#include "server/service/services.h"

namespace selfcal::server {

// How late a watch notices that its reader has gone or the daemon stops.
inline constexpr std::chrono::milliseconds kWatchPoll{100};

// Takes what arrives in the mailbox and hands it to `write`, which returns
// whether the reader is still there and sets *done after the last value.
// Returns when the reader has gone, the daemon stops, or *done.
template <typename T, typename Write>
grpc::Status Watch(const ServiceContext& context,
                   grpc::ServerContext* call,
                   Mailbox<T>* mailbox,
                   const Write& write) {
  bool done = false;
  while (!done) {
    if (context.stopping->load()) return ShuttingDown();
    if (call->IsCancelled()) return grpc::Status::CANCELLED;
    const auto value = mailbox->Take(kWatchPoll);
    if (value && !write(*value, &done)) return grpc::Status::CANCELLED;
  }
  return grpc::Status::OK;
}

}  // namespace selfcal::server
