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

TEST_F(ReportCommand, ShowsEveryBlockThatThereIsInItsUnit) {
  Rig rig = ARig("device");
  rig.factory.imu1.emplace();
  AddEstimatedBlocks({{"*", true}}, &rig.factory);
  const auto components = TangentComponents(rig.factory);
  daemon_.rigs = {ToProto(rig)};
  for (v1::Calibration& version : daemon_.calibrations) {
    version.clear_estimates();
    for (const TangentComponent& component : components) {
      auto* estimate = version.add_estimates();
      estimate->set_component(component.name);
      estimate->set_unit(component.unit);
      estimate->set_value(0.5);
      estimate->set_sigma(0.01);
    }
  }
  const Outcome outcome = Selfcal({"report", "device", "--output", path_});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string html = File();
  for (const TangentComponent& component : components) {
    EXPECT_THAT(html,
                HasSubstr("<td>" + component.name +
                          "</td><td class=\"number\">0.500</td>"
                          "<td class=\"number\">0.01</td><td>" +
                          component.unit + "</td>"));
    EXPECT_THAT(html, HasSubstr(component.name + " over time"));
  }
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
