// A small file system that becomes full under the daemon, and has room again.
#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <string>

#include "proto/resource_names.h"
#include "selfcal/v1/store_service.grpc.pb.h"
#include "test/promise.h"
#include "test/server/daemon/daemon_fixture.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

// File systems, a third of which a filler takes at first.
constexpr std::size_t kSmallBytes = 3 << 20;
// A twentieth has room for the scores of what is stored.
constexpr std::size_t kLargerBytes = 24 << 20;

class FullDiskTest : public DaemonTest {
 protected:
  FullDiskTest() { fs::create_directory(state_); }

  // The daemon on a state folder of its own of this size, which nobody else
  // sees; nothing where the system does not let this process have one.
  std::unique_ptr<Process> StartOnSmallDisk(std::size_t bytes,
                                            const std::string& options) {
    const std::string unshare =
        geteuid() == 0 ? "unshare -m" : "unshare -m --map-root-user";
    const std::string mount =
        "mount -t tmpfs -o mode=0700,size=" + std::to_string(bytes) + " none " +
        state_.string();
    const std::string quiet = " >/dev/null 2>&1";
    if (std::system((unshare + " sh -c '" + mount + "'" + quiet).c_str())) {
      return nullptr;
    }
    // It listens outside, where this process sees it.
    auto daemon = std::make_unique<Process>(
        std::vector<std::string>{
            "/bin/sh",
            "-c",
            "exec " + unshare + " sh -c '" + mount + " && head -c " +
                std::to_string(bytes / 3) + " /dev/zero >" +
                (state_ / "filler").string() + " && exec " + SELFCALD_PATH +
                " --state-dir " + state_.string() + " --listen unix:" +
                (folder_ / "socket").string() + options + "'"},
        folder_ / "log");
    EXPECT_TRUE(daemon->Says("selfcald ready")) << daemon->Log();
    channel_ = grpc::CreateChannel("unix:" + (folder_ / "socket").string(),
                                   grpc::InsecureChannelCredentials());
    return daemon;
  }

  // Its state folder, seen from here.
  fs::path StateOf(const Process& daemon) const {
    return fs::path("/proc") / std::to_string(daemon.pid()) / "root" /
           state_.relative_path();
  }

  // Sends until one is not stored; why it is not.
  grpc::Status StreamUntilRefused(int most) {
    grpc::ClientContext context;
    const auto stub = v1::SegmentService::NewStub(channel_);
    const auto stream = stub->StreamSegments(&context);
    for (int k = 0; k < most; ++k) {
      v1::StreamSegmentsRequest request;
      request.set_parent("rigs/r");
      segment_.key.index = next_index_;
      *request.mutable_segment() = ToProto(segment_);
      v1::StreamSegmentsResponse response;
      if (!stream->Write(request) || !stream->Read(&response)) {
        return stream->Finish();
      }
      EXPECT_EQ(response.verdict(), v1::StreamSegmentsResponse::STORED);
      acknowledged_.insert(SegmentName("r", segment_.key));
      ++next_index_;
    }
    stream->WritesDone();
    return stream->Finish();
  }

  // Acknowledged ones that the daemon does not have.
  int Lost() {
    std::set<std::string> lost = acknowledged_;
    grpc::ClientContext context;
    v1::ListSegmentsRequest request;
    request.set_parent("rigs/r");
    request.set_page_size(1000);
    v1::ListSegmentsResponse response;
    const auto stub = v1::SegmentService::NewStub(channel_);
    EXPECT_TRUE(stub->ListSegments(&context, request, &response).ok());
    EXPECT_EQ(response.next_page_token(), "");
    for (const v1::Segment& segment : response.segments()) {
      lost.erase(segment.name());
    }
    return static_cast<int>(lost.size());
  }

  bool IsSound() {
    grpc::ClientContext context;
    const auto stub = v1::StoreService::NewStub(channel_);
    const auto reader = stub->CheckStore(&context, v1::CheckStoreRequest());
    v1::CheckStoreResponse response;
    bool sound = false;
    while (reader->Read(&response)) {
      sound = response.has_summary() && response.summary().problems() == 0;
    }
    return reader->Finish().ok() && sound;
  }

  MotionSegment segment_ = TestSegments(TestRig("r"), 1).front();
  std::int64_t next_index_ = 0;
  std::set<std::string> acknowledged_;
};

TEST_F(FullDiskTest, RefusesLosesNothingAndGoesOnWhenThereIsRoom) {
  const auto daemon = StartOnSmallDisk(kSmallBytes, " --min-free-bytes 0");
  if (!daemon) GTEST_SKIP() << "no file system of its own to be had";
  Promise promise("a full file system refuses cleanly");
  Rig rig = TestRig("r");
  rig.table_size = 100;
  CreateRig(rig);
  const grpc::Status refused = StreamUntilRefused(1000);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED)
      << refused.error_message();
  const std::size_t before = acknowledged_.size();
  EXPECT_GT(before, 3u);
  EXPECT_LT(before, 1000u);
  promise.lost += Lost();
  // Again, as a client does that tries later.
  EXPECT_FALSE(StreamUntilRefused(1000).ok());
  promise.lost += Lost();

  fs::remove(StateOf(*daemon) / "filler");
  EXPECT_TRUE(StreamUntilRefused(3).ok());
  EXPECT_GE(acknowledged_.size(), before + 3);
  promise.lost += Lost();
  promise.lost += IsSound() ? 0 : 1;
  promise.trials = static_cast<int>(acknowledged_.size());
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
}

TEST_F(FullDiskTest, TheLastOfTheDiskStaysFreeForOthers) {
  const auto daemon = StartOnSmallDisk(kLargerBytes, "");
  if (!daemon) GTEST_SKIP() << "no file system of its own to be had";
  Rig rig = TestRig("r");
  rig.table_size = 100;
  CreateRig(rig);
  const grpc::Status refused = StreamUntilRefused(1000);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(refused.error_message(), ::testing::HasSubstr("min-free-bytes"));
  const fs::space_info disk = fs::space(StateOf(*daemon));
  EXPECT_GT(disk.available, 0u);
  EXPECT_LT(disk.available, disk.capacity / 5);
  EXPECT_EQ(Lost(), 0);
  fs::remove(StateOf(*daemon) / "filler");
  EXPECT_TRUE(StreamUntilRefused(3).ok());
  EXPECT_EQ(Lost(), 0);
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
}

}  // namespace
}  // namespace selfcal::server
