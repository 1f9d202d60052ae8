// selfcal report.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;

class ReportCommand : public Commands {
 protected:
  ReportCommand() {
    daemon_.rigs.push_back(ToProto(ARig("device")));
    daemon_.calibrations = {Version(1), Version(2)};
  }

  std::string File() const { return ReadBytes(path_); }

  const std::string path_ = temp_folder_.File("report.html");
};

TEST_F(ReportCommand, WritesOneFile) {
  const Outcome outcome = Selfcal({"report", "device", "--output", path_});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_filter, "state = SCORED");
  EXPECT_THAT(File(), HasSubstr("Calibration of device, version 2"));
}

TEST_F(ReportCommand, OverwritesOnlyWhenAskedAndLeavesNothingHalf) {
  ASSERT_EQ(Selfcal({"report", "device", "--output", path_}).code, 0);
  const Outcome again = Selfcal({"report", "device", "--output", path_});
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.err, HasSubstr("--force"));
  EXPECT_EQ(Selfcal({"report", "device", "--output", path_, "--force"}).code,
            0);

  std::remove(path_.c_str());
  const Outcome nobody = Selfcal({"report", "nobody", "--output", path_});
  EXPECT_EQ(nobody.code, 1);
  EXPECT_EQ(File(), "");
}

}  // namespace
}  // namespace selfcal::client
