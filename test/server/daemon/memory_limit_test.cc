// The daemon's memory while many clients send segments that are as large as a
// message may be.
#include <gmock/gmock.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "test/promise.h"
#include "test/server/daemon/daemon_fixture.h"
#include "test/server/large_segment.h"

namespace selfcal::server {
namespace {

constexpr int kSettingMiB = 128;
// The memory that the largest message takes while it is received, converted and
// stored, and that of the segment which is scored, beyond the setting
// (operations.md).
constexpr int kConstantMiB = 512;
constexpr std::size_t kLargeBytes = 48'000'000;

class MemoryLimit : public DaemonTest {
 protected:
  // Stores on a connection of its own, and repeats while the daemon has no
  // room.
  bool Store(const std::string& rig, const MotionSegment& segment) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetMaxSendMessageSize(-1);
    const auto stub = v1::SegmentService::NewStub(
        grpc::CreateCustomChannel("unix:" + (state_ / "selfcald.sock").string(),
                                  grpc::InsecureChannelCredentials(),
                                  arguments));
    v1::StreamSegmentsRequest request;
    request.set_parent("rigs/" + rig);
    *request.mutable_segment() = ToProto(segment);
    bool stored = false;
    Eventually(
        [&] {
          grpc::ClientContext context;
          const auto stream = stub->StreamSegments(&context);
          v1::StreamSegmentsResponse response;
          // DUPLICATE: it was stored before, and its answer was lost with a
          // stream that was cut off.
          stored = stream->Write(request) && stream->Read(&response) &&
                   response.verdict() != v1::StreamSegmentsResponse::REJECTED;
          stream->WritesDone();
          while (stream->Read(&response)) {
          }
          stream->Finish().IgnoreError();
          return stored;
        },
        10 * kLongWait,
        kDaemonInterval);
    return stored;
  }
};

TEST_F(MemoryLimit, LargeSegmentsOfManyClientsStayWithinTheSetting) {
  const auto daemon =
      StartAndWait({"--max-memory-bytes", std::to_string(kSettingMiB << 20)});
  const int clients = Trials(4);
  const MotionSegment small = TestSegments(TestRig("any"), 1).front();
  const MotionSegment large = Enlarged(small, kLargeBytes);
  CreateRig(TestRig("small"));
  for (int k = 0; k < clients; ++k) {
    CreateRig(TestRig("large" + std::to_string(k)));
  }
  std::atomic<int> stored{0};
  std::vector<std::thread> threads;
  threads.reserve(static_cast<std::size_t>(clients));
  for (int k = 0; k < clients; ++k) {
    threads.emplace_back(
        [&, k] { stored += Store("large" + std::to_string(k), large); });
  }
  EXPECT_TRUE(Store("small", small));
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(stored, clients);
  Promise promise("memory stays within its setting");
  promise.trials = clients;
  promise.lost = daemon->PeakMiB() > kSettingMiB + kConstantMiB;
  EXPECT_LE(daemon->PeakMiB(), kSettingMiB + kConstantMiB);
}

}  // namespace
}  // namespace selfcal::server
