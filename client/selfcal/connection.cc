#include "client/selfcal/connection.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>

#include <exception>
#include <random>

namespace selfcal::client {

std::shared_ptr<grpc::Channel> MakeChannel(const std::string& target) {
  grpc::ChannelArguments arguments;
  // A failed connection that is shared would impose its own waiting time.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // Finds out that the other end is gone without a word; servers allow a ping
  // every five minutes by default.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 6 * 60 * 1000);
  return grpc::CreateCustomChannel(
      target, grpc::InsecureChannelCredentials(), arguments);
}

absl::Status ToAbsl(const grpc::Status& status) {
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()),
                      status.error_message());
}

std::uint64_t JitterSeed(const void* object) {
  const auto address = reinterpret_cast<std::uintptr_t>(object);
  try {
    return address ^ std::random_device{}();
  } catch (const std::exception&) {
    return address;  // no entropy on this device: only jitter suffers
  }
}

}  // namespace selfcal::client
