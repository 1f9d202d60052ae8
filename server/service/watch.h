// The loop of a watch, which forwards values from a mailbox to a client's
// stream.
#pragma once

#include <grpcpp/server_context.h>

#include <chrono>

#include "server/service/errors.h"
#include "server/service/mailbox.h"
#include "server/service/services.h"

namespace selfcal::server {

// Delay after which a watch notices that its client has disconnected or the
// daemon is stopping.
inline constexpr std::chrono::milliseconds kWatchPoll{100};

// Takes values from the mailbox and passes them to `write`, which returns false
// if the client has disconnected, and sets *done after the last value. Returns
// when the client has disconnected, the daemon is stopping, or *done is true.
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
