// selfcal run start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;

class RecalibrateCommand : public Commands {
 protected:
  RecalibrateCommand() {
    v1::Recalibration run;
    run.set_name("rigs/device/recalibrations/1");
    run.set_state(v1::Recalibration::PENDING);
    daemon_.run.push_back(run);
    run.set_state(v1::Recalibration::RUNNING);
    daemon_.run.push_back(run);
    run.set_state(v1::Recalibration::SUCCEEDED);
    run.set_calibration("rigs/device/calibrations/2");
    daemon_.run.push_back(run);
    daemon_.calibrations = {Version(1), Version(2)};
  }
};

TEST_F(RecalibrateCommand, WaitsForTheEndAndShowsTheValues) {
  const Outcome outcome = Selfcal({"recalibrate", "device"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "") << "no progress bar but on a terminal";
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/2");
  EXPECT_THAT(outcome.out, HasSubstr("state\tsucceeded\n"));
  EXPECT_THAT(outcome.out, HasSubstr("verdict\tunknown\n"));
  EXPECT_THAT(outcome.out, HasSubstr("cam0.focal.x\t255.123\tpx\t0.034\n"));
}

TEST_F(RecalibrateCommand, ForcesWhatHasNotChanged) {
  EXPECT_EQ(Selfcal({"recalibrate", "device", "--no-wait"}).code, 0);
  EXPECT_FALSE(daemon_.last_force);
  EXPECT_EQ(Selfcal({"recalibrate", "device", "--force", "--no-wait"}).code, 0);
  EXPECT_TRUE(daemon_.last_force);
}

TEST_F(RecalibrateCommand, OutlivesTheConnection) {
  daemon_.broken_watches = 2;
  const Outcome outcome = Selfcal({"recalibrate", "device", "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(Parse<v1::Recalibration>(outcome.out).state(),
            v1::Recalibration::SUCCEEDED);
}

TEST_F(RecalibrateCommand, ReturnsAtOnceIfAskedTo) {
  const Outcome outcome = Selfcal({"recalibrate", "device", "--no-wait"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("state\tpending\n"));
}

TEST_F(RecalibrateCommand, ExitsWithOneIfTheResultWasRejected) {
  daemon_.calibrations[1].set_state(v1::Calibration::REJECTED);
  daemon_.calibrations[1].add_reasons("held-out segments fit worse");
  const Outcome outcome = Selfcal({"recalibrate", "device"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("held-out segments fit worse"));
}

TEST_F(RecalibrateCommand, ExitsWithOneIfItFailedOrCouldNotStart) {
  daemon_.run[2].set_state(v1::Recalibration::FAILED);
  daemon_.run[2].set_message("no segment has enough inliers");
  const Outcome failed = Selfcal({"recalibrate", "device"});
  EXPECT_EQ(failed.code, 1);
  EXPECT_THAT(failed.err, HasSubstr("no segment has enough inliers"));
  daemon_.run.clear();
  const Outcome refused = Selfcal({"recalibrate", "device"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("the tables are empty"));
}

}  // namespace
}  // namespace selfcal::client
