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
  grpc::Status Send(const std::string& method,
                    const std::string& bytes,
                    grpc_compression_algorithm algorithm = GRPC_COMPRESS_NONE) {
    grpc::ClientContext context;
    context.set_compression_algorithm(algorithm);
    const grpc::Slice slice(bytes);
    const grpc::ByteBuffer request(&slice, 1);
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
  const std::string zeros(std::size_t{256} << 20, '\0');
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
      const grpc::Status status = Send(method, zeros, algorithm);
      EXPECT_EQ(status.error_code(), grpc::StatusCode::UNIMPLEMENTED)
          << method << ": " << status.error_message();
      ++promise.trials;
      promise.lost += daemon->PeakMiB() - before > kAllowedMiB;
    }
  }
  CreateRig(TestRig("next"));
}

std::string Repeated(const std::string& bytes, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += bytes;
  return all;
}

// A field of this number, below 16, that holds these bytes.
std::string Field(int number, const std::string& bytes) {
  std::string field(1, static_cast<char>(number << 3 | 2));
  for (std::size_t left = bytes.size(); true; left >>= 7) {
    field += static_cast<char>((left & 127) | (left > 127 ? 128 : 0));
    if (left <= 127) return field + bytes;
  }
}

// Two bytes for each field that the program does not know, or for each empty
// camera of a rig or table of a report, become a hundred or more: gigabytes.
TEST_F(CompressedMessages, NorAreManyElementsParsed) {
  constexpr int kElements = 15 << 20;  // 30 MiB
  constexpr int kAllowedMiB = 200;     // a few copies of the bytes
  const auto daemon = StartAndWait();
  CreateRig();
  const int before = daemon->PeakMiB();
  const std::string unknown = Repeated(std::string("\x7a\0", 2), kElements);
  const std::string camera(std::string("\x12\0", 2));
  const std::string rig =
      Field(1, Field(2, Repeated(camera, kElements)));  // factory.cameras
  // records.tables, within the bytes of a report
  const std::string report =
      Field(5, Repeated(std::string("\x0a\0", 2), kElements));
  const std::pair<const char*, const std::string*> requests[] = {
      {"/selfcal.v1.UplinkService/Report", &report},
      {"/selfcal.v1.RigService/GetRig", &unknown},
      {"/selfcal.v1.RigService/CreateRig", &rig},
      {"/selfcal.v1.SegmentService/StreamSegments", &unknown},
      {"/selfcal.v1.SegmentService/DownloadSegments", &unknown},
      {"/selfcal.v1.CalibrationService/WatchCalibration", &unknown},
      {"/selfcal.v1.StoreService/RestoreStore", &unknown}};
  Promise promise("a message takes no more memory than its share");
  for (const auto& [method, bytes] : requests) {
    const grpc::Status status = Send(method, *bytes);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED)
        << method << ": " << status.error_message();
    ++promise.trials;
    promise.lost += daemon->PeakMiB() - before > kAllowedMiB;
  }
  CreateRig(TestRig("next"));
}

}  // namespace
}  // namespace selfcal::server
