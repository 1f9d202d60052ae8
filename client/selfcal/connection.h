// What both streams of the client need from gRPC.
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

// A channel of its own, which shares neither connection nor backoff with any
// other: an attempt to connect begins at the first call. With the certificates
// of the options as they are on disk now; FAILED_PRECONDITION if one cannot be
// read.
absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(
    const ClientOptions& options);
// Without TLS.
std::shared_ptr<grpc::Channel> MakeChannel(const std::string& target);

absl::Status ToAbsl(const grpc::Status& status);

// A seed that differs between devices and between objects of a process.
std::uint64_t JitterSeed(const void* object);

}  // namespace selfcal::client
