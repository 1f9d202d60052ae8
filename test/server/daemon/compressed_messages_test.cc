// Messages that are small on the wire and large in memory.
#include <grpc/compression.h>
#include <grpcpp/generic/generic_stub.h>

#include <array>
#include <string>
#include <vector>

#include "test/promise.h"
#include "test/server/daemon/daemon_fixture.h"

namespace selfcal::server {
namespace {

class CompressedMessages : public DaemonTest {
 protected:
  // Sends zeros, compressed.
  grpc::Status Send(const std::string& method,
                    std::size_t bytes,
                    grpc_compression_algorithm algorithm) {
    grpc::ClientContext context;
    context.set_compression_algorithm(algorithm);
    const grpc::Slice zeros(std::string(bytes, '\0'));
    const grpc::ByteBuffer request(&zeros, 1);
    grpc::GenericStub stub(channel_);
    grpc::CompletionQueue queue;
    const auto call = stub.PrepareUnaryCall(&context, method, request, &queue);
    call->StartCall();
    grpc::ByteBuffer response;
    grpc::Status status;
    call->Finish(&response, &status, nullptr);
    void* tag = nullptr;
    bool ok = false;
    const auto result = queue.AsyncNext(
        &tag, &ok, std::chrono::system_clock::now() + kLongWait);
    EXPECT_EQ(result, grpc::CompletionQueue::GOT_EVENT) << method;
    return status;
  }
};

TEST_F(CompressedMessages, AreRefusedBeforeTheyAreInflated) {
  constexpr std::size_t kBytes = std::size_t{256} << 20;
  constexpr int kAllowedMiB = 32;
  const auto daemon = StartAndWait();
  CreateRig();
  const int before = daemon->PeakMiB();
  Promise promise("a compressed message takes no more memory than its bytes");
  for (const char* method : {"/grpc.health.v1.Health/Check",
                             "/selfcal.v1.RigService/GetRig",
                             "/selfcal.v1.SegmentService/StreamSegments",
                             "/selfcal.v1.StoreService/RestoreStore"}) {
    for (const auto algorithm : {GRPC_COMPRESS_GZIP, GRPC_COMPRESS_DEFLATE}) {
      const grpc::Status status = Send(method, kBytes, algorithm);
      EXPECT_EQ(status.error_code(), grpc::StatusCode::UNIMPLEMENTED)
          << method << ": " << status.error_message();
      ++promise.trials;
      promise.lost += daemon->PeakMiB() - before > kAllowedMiB;
    }
  }
  CreateRig(TestRig("next"));
}

}  // namespace
}  // namespace selfcal::server
