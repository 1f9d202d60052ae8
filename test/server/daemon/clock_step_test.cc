// A daemon whose wall clock is set while it runs, by libfaketime.
#include <gmock/gmock.h>

#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "selfcal/v1/store_service.grpc.pb.h"
#include "test/server/daemon/daemon_fixture.h"
#include "test/support/files.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::SizeIs;

class ClockStepTest : public DaemonTest {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "libfaketime cannot be loaded beside a sanitizer";
#endif
    for (const auto& folder : std::filesystem::directory_iterator("/usr/lib")) {
      const auto file = folder.path() / "faketime/libfaketimeMT.so.1";
      if (std::filesystem::exists(file)) library_ = file;
    }
    if (library_.empty()) GTEST_SKIP() << "libfaketime is not installed";
  }

  // Starts it with a clock that `offset` shifts, as libfaketime reads it:
  // "+300d".
  std::unique_ptr<Process> StartShifted(const std::string& offset) {
    SetClock(offset);
    auto daemon = std::make_unique<Process>(
        std::vector<std::string>{"/usr/bin/env",
                                 "LD_PRELOAD=" + library_.string(),
                                 "FAKETIME_TIMESTAMP_FILE=" + clock_.string(),
                                 "FAKETIME_NO_CACHE=1",
                                 "FAKETIME_DONT_FAKE_MONOTONIC=1",
                                 SELFCALD_PATH,
                                 "--state-dir",
                                 state_.string()},
        folder_ / "log");
    EXPECT_TRUE(daemon->Says("selfcald ready: listening on unix:"))
        << daemon->Log();
    Connect();
    return daemon;
  }

  void SetClock(const std::string& offset) const {
    const std::filesystem::path next = folder_ / "next_clock";
    WriteBytes(next, offset + "\n");
    std::filesystem::rename(next, clock_);
  }

  // Whose segments leave its tables after a week.
  void CreateAgeingRig() {
    grpc::ClientContext context;
    v1::CreateRigRequest request;
    *request.mutable_rig() = ToProto(TestRig("r"));
    request.mutable_rig()->set_table_size(8);
    request.mutable_rig()->mutable_table_max_age()->set_seconds(7 * 86400);
    v1::Rig created;
    const auto stub = v1::RigService::NewStub(channel_);
    ASSERT_TRUE(stub->CreateRig(&context, request, &created).ok());
  }

  std::vector<std::string> Steps() {
    grpc::ClientContext context;
    v1::ListEventsResponse events;
    const auto stub = v1::StoreService::NewStub(channel_);
    EXPECT_TRUE(stub->ListEvents(&context, {}, &events).ok());
    std::vector<std::string> details;
    for (const v1::Event& event : events.events()) {
      if (event.kind() == v1::Event::CLOCK_STEPPED) {
        details.push_back(event.detail());
      }
    }
    return details;
  }

  // Names of the segments that a table holds.
  std::set<std::string> Held() {
    std::set<std::string> names;
    const v1::ListTablesResponse listed = Tables();
    for (const v1::Table& table : listed.tables()) {
      for (const auto& entry : table.entries()) names.insert(entry.segment());
    }
    return names;
  }

 private:
  std::filesystem::path library_;
  const std::filesystem::path clock_ = folder_ / "clock";
};

TEST_F(ClockStepTest, KeepsItsTablesAndSaysWhatHappened) {
  const auto segments = TestSegments(TestRig("r"), 3);
  // Half a century ago, as a device without a battery for its clock.
  const auto daemon = StartShifted("-18250d");
  CreateAgeingRig();
  Stream({segments[0], segments[1]});
  ASSERT_TRUE(AllScored());
  const std::set<std::string> held = Held();
  EXPECT_THAT(held, SizeIs(2));
  SetClock("+0d");
  EXPECT_TRUE(Eventually(
      [&] { return Steps().size() == 1; }, kLongWait, kDaemonInterval));
  EXPECT_THAT(Steps(),
              ElementsAre(HasSubstr("the wall clock was set from 19")));
  Stream({segments[2]});
  ASSERT_TRUE(AllScored());
  EXPECT_THAT(Held(), IsSupersetOf(held));
}

}  // namespace
}  // namespace selfcal::server
