// selfcal top. The drawing on a terminal is in top_terminal_test.py.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "client/cli/top_view.h"
#include "selfcal/v1/activity_service.grpc.pb.h"
#include "test/client/cli/commands_fixture.h"
#include "test/support/grpc_server.h"

namespace selfcal::client {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::int64_t kNow = 1'795'234'203;

v1::ListActivityResponse TwoRigs() {
  v1::ListActivityResponse activity;
  activity.mutable_time()->set_seconds(kNow);
  activity.mutable_start_time()->set_seconds(kNow - 3 * 86400);
  activity.mutable_traffic()->set_streams(2);
  activity.mutable_traffic()->set_stored(1203);
  activity.mutable_traffic()->set_stored_per_minute(8.04);
  v1::RigActivity* rig = activity.add_rigs();
  rig->set_name("rigs/tablet");
  rig->mutable_last_seen()->set_seconds(kNow - 3);
  rig->set_active_version(4);
  rig->mutable_active_since()->set_seconds(kNow - 3 * 3600);
  rig->set_table_entries(20);
  rig->set_table_capacity(24);
  rig->mutable_traffic()->set_streams(2);
  rig->mutable_traffic()->set_stored(17);
  rig->mutable_traffic()->set_stored_per_minute(8.04);
  rig->mutable_traffic()->set_rejected(1);
  rig->mutable_run()->set_name("rigs/tablet/recalibrations/5");
  rig->mutable_run()->set_state(v1::Recalibration::RUNNING);
  rig->mutable_run()->set_iteration(4);
  rig->mutable_run()->set_max_iterations(100);
  rig->mutable_device()->mutable_time()->set_seconds(kNow - 2);
  rig->mutable_device()->set_waiting(12);
  rig = activity.add_rigs();
  rig->set_name("rigs/silent");
  rig->set_active_version(1);
  rig->mutable_active_since()->set_seconds(kNow - 86400 * 30);
  return activity;
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST(AgeText, NamesTheUnitThatFits) {
  EXPECT_EQ(AgeText(-5), "0 s");
  EXPECT_EQ(AgeText(119), "119 s");
  EXPECT_EQ(AgeText(120), "2 min");
  EXPECT_EQ(AgeText(7199), "119 min");
  EXPECT_EQ(AgeText(7200), "2 h");
  EXPECT_EQ(AgeText(172'800), "2 d");
}

TEST(ActivityScreen, TellsAllAndThenEachRig) {
  const auto lines = Lines(ActivityScreen(TwoRigs(), 200, 24));
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_EQ(lines[0],
            "2026-11-21 04:10:03  up 3 d  streams 2  stored 1203 (8.0 a "
            "minute)  rejected 0");
  EXPECT_THAT(lines[2], HasSubstr("last seen"));
  EXPECT_THAT(lines[3], testing::StartsWith("tablet"));
  for (const char* cell : {"3 s", "3 h", "20/24", "5 running 4/100"}) {
    EXPECT_THAT(lines[3], HasSubstr(cell));
  }
  EXPECT_THAT(lines[4], testing::ContainsRegex("^silent +- +1 +30 d +0/0"));
}

TEST(ActivityScreen, FitsTheTerminal) {
  v1::ListActivityResponse many = TwoRigs();
  while (many.rigs_size() < 100) *many.add_rigs() = many.rigs(0);
  for (const int columns : {1, 20, 80}) {
    for (const int rows : {1, 4, 24}) {
      const auto lines = Lines(ActivityScreen(many, columns, rows));
      EXPECT_EQ(lines.size(), static_cast<std::size_t>(rows));
      for (const std::string& line : lines) {
        EXPECT_LE(line.size(), static_cast<std::size_t>(columns));
      }
    }
  }
  EXPECT_EQ(RigsOnScreen(24), 21);
  EXPECT_EQ(RigsOnScreen(1), 1);
}

// A daemon that answers with two rigs.
class TopCommand : public ::testing::Test,
                   private v1::ActivityService::Service {
 protected:
  TopCommand() { server_.Start(); }
  ~TopCommand() override { server_.Stop(); }

  Outcome Top(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "top");
    arguments.insert(arguments.end(), {"--target", server_.target()});
    return Selfcal(arguments);
  }

  int asked_for_ = 0;

 private:
  grpc::Status ListActivity(grpc::ServerContext*,
                            const v1::ListActivityRequest* request,
                            v1::ListActivityResponse* response) override {
    asked_for_ = request->page_size();
    *response = TwoRigs();
    return grpc::Status::OK;
  }

  GrpcServer server_{{this}};
};

TEST_F(TopCommand, IsOneRecordALineInAPipe) {
  const Outcome outcome = Top({});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(asked_for_, 50);
  EXPECT_THAT(
      Lines(outcome.out),
      ElementsAre(
          "tablet\t2026-11-21 04:10:00\t4\t2026-11-21 01:10:03\t20/24"
          "\t2\t17\t8.0\t1\t5 running 4/100\t2026-11-21 04:10:01, 12 wait",
          "silent\t-\t1\t2026-10-22 04:10:03\t0/0\t0\t0\t0.0\t0\t-\t-"));
}

TEST_F(TopCommand, IsTheMessageInJson) {
  const Outcome outcome = Top({"--json", "--rigs", "7"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(asked_for_, 7);
  v1::ListActivityResponse parsed;
  ASSERT_TRUE(
      google::protobuf::util::JsonStringToMessage(outcome.out, &parsed).ok());
  EXPECT_EQ(parsed.SerializeAsString(), TwoRigs().SerializeAsString());
}

TEST_F(TopCommand, RefusesWhatItCannotShow) {
  EXPECT_EQ(Top({"--rigs", "1001"}).code, 2);
  EXPECT_EQ(Top({"--interval", "0"}).code, 2);
}

TEST(TopWithoutADaemon, SaysSo) {
  EXPECT_EQ(Selfcal({"top", "--target", "unix:/nonexistent/sock"}).code, 3);
}

}  // namespace
}  // namespace selfcal::client
