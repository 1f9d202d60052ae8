// gRPC channels and statuses for both streams of the client.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/channel.h>
#include <grpcpp/support/status.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "client/selfcal/client.h"

namespace selfcal::client {

// Returns a channel that shares neither its connection nor its backoff with
// other channels; it connects at the first call. Reads the certificates of the
// options from disk; FAILED_PRECONDITION if one cannot be read.
absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(
    const ClientOptions& options);
// Returns a channel without TLS.
std::shared_ptr<grpc::Channel> MakeChannel(const std::string& target);

absl::Status ToAbsl(const grpc::Status& status);

// Returns a seed that differs between devices and between objects of a process.
std::uint64_t JitterSeed(const void* object);

}  // namespace selfcal::client
