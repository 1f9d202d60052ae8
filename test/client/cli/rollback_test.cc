// selfcal calibration rollback.
#include <gmock/gmock.h>
#include <google/protobuf/util/time_util.h>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using google::protobuf::util::TimeUtil;
using testing::HasSubstr;
using testing::Not;

class Rollback : public Commands {
 protected:
  // A rig with versions 1 (superseded), 2 (superseded), 3 (rolled back),
  // 4 (active, an hour old) and 5 (rejected), newest first.
  Rollback() {
    daemon_.rigs.resize(1);
    daemon_.rigs[0].set_name("rigs/device");
    using State = v1::Calibration;
    const auto hour_ago =
        TimeUtil::GetCurrentTime() - TimeUtil::HoursToDuration(1);
    for (const auto& [version, state] :
         std::vector<std::pair<int, v1::Calibration::State>>{
             {5, State::REJECTED},
             {4, State::ACTIVE},
             {3, State::ROLLED_BACK},
             {2, State::SUPERSEDED},
             {1, State::SUPERSEDED}}) {
      daemon_.calibrations.push_back(Version(version));
      daemon_.calibrations.back().set_state(state);
      *daemon_.calibrations.back().mutable_create_time() = hour_ago;
    }
  }

  // As the command leaves it: 4 is rolled back, 2 is active again.
  void LeaveRolledBack() {
    daemon_.calibrations[1].set_state(v1::Calibration::ROLLED_BACK);
    daemon_.calibrations[3].set_state(v1::Calibration::ACTIVE);
  }

  Outcome RollBack(std::vector<std::string> more) const {
    std::vector<std::string> line = {"calibration",
                                     "rollback",
                                     "--filter",
                                     "labels.batch = \"b\"",
                                     "--reason",
                                     "bad firmware"};
    line.insert(line.end(), more.begin(), more.end());
    return Selfcal(line);
  }
};

TEST_F(Rollback, ActivatesTheVersionBefore) {
  const Outcome outcome = RollBack({"--yes"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("device\t4\t2"));
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/2");
  EXPECT_EQ(daemon_.last_reason, "bad firmware");
}

TEST_F(Rollback, OnlyShowsWhatItWouldDo) {
  const Outcome outcome = RollBack({"--dry-run"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("device\t4\t2"));
  EXPECT_EQ(daemon_.last_reason, "");
}

TEST_F(Rollback, IsAListOfVersionsInJson) {
  const Outcome outcome = RollBack({"--dry-run", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  v1::Calibration version;
  ASSERT_TRUE(
      google::protobuf::util::JsonStringToMessage(outcome.out, &version).ok())
      << outcome.out;
  EXPECT_EQ(version.version(), 2);
}

TEST_F(Rollback, LeavesWhatIsOlderThanTheTime) {
  const Outcome newer = RollBack({"--yes", "--since", "2h"});
  EXPECT_THAT(newer.out, HasSubstr("device"));
  daemon_.last_reason.clear();
  const Outcome older = RollBack({"--yes", "--since", "10m"});
  EXPECT_EQ(older.code, 0) << older.err;
  EXPECT_THAT(older.out, Not(HasSubstr("device")));
  EXPECT_EQ(daemon_.last_reason, "");
  EXPECT_EQ(RollBack({"--yes", "--since", "soon"}).code, 2);
}

TEST_F(Rollback, HasNothingToDoForARigWithoutAnEarlierVersion) {
  daemon_.calibrations.resize(2);
  const Outcome outcome = RollBack({"--yes"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_reason, "");
}

// A command that fails for some rigs is repeated.
TEST_F(Rollback, LeavesARigThatIsRolledBackAlready) {
  LeaveRolledBack();
  const Outcome outcome = RollBack({"--yes"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, Not(HasSubstr("device")));
  EXPECT_THAT(outcome.err,
              HasSubstr("device is rolled back already, from version 4 to 2"));
  EXPECT_EQ(daemon_.last_reason, "");
}

TEST_F(Rollback, GoesFurtherBackOnDemand) {
  LeaveRolledBack();
  const Outcome outcome = RollBack({"--yes", "--again"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("device\t2\t1"));
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/1");
}

TEST_F(Rollback, RollsBackAVersionThatCameAfterARollBack) {
  LeaveRolledBack();
  daemon_.calibrations[3].set_state(v1::Calibration::SUPERSEDED);
  daemon_.calibrations[0].set_state(v1::Calibration::ACTIVE);
  const Outcome outcome = RollBack({"--yes"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("device\t5\t2"));
}

TEST_F(Rollback, LeavesOutARigThatIsDeletedMeanwhile) {
  daemon_.rigs.insert(daemon_.rigs.begin(), daemon_.rigs[0]);
  daemon_.rigs[0].set_name("rigs/scrapped");
  daemon_.deleted = "rigs/scrapped";
  const Outcome outcome = RollBack({"--yes"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("scrapped does not exist any more"));
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/2");
}

TEST_F(Rollback, ReadsDetailsOnlyWhereItShowsThem) {
  ASSERT_EQ(RollBack({"--dry-run"}).code, 0);
  EXPECT_EQ(daemon_.last_view, v1::ListCalibrationsRequest::BASIC);
  ASSERT_EQ(RollBack({"--dry-run", "--json"}).code, 0);
  EXPECT_NE(daemon_.last_view, v1::ListCalibrationsRequest::BASIC);
}

TEST_F(Rollback, NeedsAFilterAndAReason) {
  EXPECT_EQ(Selfcal({"calibration", "rollback", "--reason", "r"}).code, 2);
  EXPECT_EQ(Selfcal({"calibration", "rollback", "--filter", "f"}).code, 2);
}

}  // namespace
}  // namespace selfcal::client
