// selfcal run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;

class RunsCommand : public Commands {
 protected:
  RunsCommand() {
    v1::Recalibration run;
    run.set_name("rigs/device/recalibrations/3");
    run.set_state(v1::Recalibration::RUNNING);
    run.set_trigger(v1::Recalibration::TABLES_FULL);
    run.mutable_create_time()->set_seconds(1'795'234'203);
    run.add_segments("rigs/device/segments/walk~0");
    daemon_.run.push_back(run);
    run.set_state(v1::Recalibration::SUCCEEDED);
    run.set_calibration("rigs/device/calibrations/2");
    daemon_.run.push_back(run);
    daemon_.calibrations = {Version(1), Version(2)};
  }
};

TEST_F(RunsCommand, ListsThemALineEach) {
  const Outcome outcome = Selfcal({"runs", "list", "device"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_name, "rigs/device");
  EXPECT_EQ(outcome.out,
            "3\trunning\ttables full\t2026-11-21 04:10:03\t-\t1\t-\t\n"
            "3\tsucceeded\ttables full\t2026-11-21 04:10:03\t-\t1\t2\t\n");
}

TEST_F(RunsCommand, ShowsOne) {
  const Outcome outcome = Selfcal({"runs", "show", "device", "3"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_name, "rigs/device/recalibrations/3");
  EXPECT_THAT(outcome.out, HasSubstr("state\trunning\n"));
}

TEST_F(RunsCommand, WatchesOneToItsEnd) {
  const Outcome outcome = Selfcal({"runs", "watch", "device", "3"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("state\tsucceeded\n"));
  EXPECT_THAT(outcome.out, HasSubstr("cam0.focal.x\t255.123\tpx\t0.034\n"));
}

TEST_F(RunsCommand, WatchTellsEachUpdateAsALineOfJson) {
  auto* parameter = daemon_.run[0].add_parameters();
  parameter->set_component("cam0.focal.x");
  parameter->set_moved(0.25);
  parameter->set_sigma(0.5);
  const Outcome outcome = Selfcal({"runs", "watch", "device", "3", "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  std::vector<v1::Recalibration> updates;
  for (std::string line; std::getline(lines, line);) {
    updates.push_back(Parse<v1::Recalibration>(line));
  }
  ASSERT_GE(updates.size(), 2u);
  ASSERT_EQ(updates.front().parameters_size(), 1);
  EXPECT_EQ(updates.front().parameters(0).component(), "cam0.focal.x");
  EXPECT_EQ(updates.front().parameters(0).moved(), 0.25);
  EXPECT_EQ(updates.front().parameters(0).sigma(), 0.5);
  EXPECT_EQ(updates.back().state(), v1::Recalibration::SUCCEEDED);
}

TEST_F(RunsCommand, WatchOfOneThatHasEndedTellsItsEnd) {
  daemon_.run.erase(daemon_.run.begin());
  const Outcome outcome = Selfcal({"runs", "watch", "device", "3", "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(Parse<v1::Recalibration>(outcome.out).state(),
            v1::Recalibration::SUCCEEDED);
}

TEST_F(RunsCommand, CancelsOne) {
  const Outcome outcome = Selfcal({"runs", "cancel", "device", "3"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.cancelled, "rigs/device/recalibrations/3");
  EXPECT_THAT(outcome.out, HasSubstr("state\tcancelled\n"));
}

TEST_F(RunsCommand, ExitsWithOneForARunThatDoesNotExist) {
  daemon_.run.clear();
  const Outcome outcome = Selfcal({"runs", "cancel", "device", "9"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("no such run"));
}

}  // namespace
}  // namespace selfcal::client
