// Calibrations to and from the files of other tools, as a user sees it.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "google/protobuf/struct.pb.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;
using testing::Not;

namespace fs = std::filesystem;

class CalibrationExport : public Commands {
 protected:
  CalibrationExport() {
    Rig rig = ARig("device");
    rig.factory.imu.s_g = {1.01, 0.99, 1.02};
    daemon_.rigs.push_back(ToProto(rig));
    // Not the factory's: what is asked for is written.
    rig.factory.cameras[0].f = {257.5, 258.5};
    v1::Calibration version = Version(2);
    *version.mutable_parameters() = ToProto(rig.factory);
    daemon_.calibrations.push_back(version);
  }

  std::vector<std::string> Line(const std::string& format) const {
    return {"calibrations",
            "export",
            "device",
            "2",
            "--format",
            format,
            "--output",
            folder_.string() + "/",
            "--imu-rate",
            "200"};
  }

  const fs::path folder_ = temp_folder_.path() / "exported";
};

TEST_F(CalibrationExport, WritesTheVersionAndNamesWhatIsLost) {
  const Outcome outcome = Selfcal(Line("maplab"));
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/2");
  EXPECT_EQ(outcome.out, (folder_ / "sensors.yaml").string() + "\n");
  EXPECT_THAT(ReadBytes(folder_ / "sensors.yaml"), HasSubstr("[257.5, 258.5,"));
  EXPECT_THAT(outcome.err, HasSubstr("lost: imu: maplab uses the readings"));
  EXPECT_THAT(outcome.err, HasSubstr("note: sigmas: "));
}

TEST_F(CalibrationExport, SeveralFilesOrOneByItsName) {
  EXPECT_EQ(Selfcal(Line("kalibr")).out,
            (folder_ / "camchain-imucam.yaml").string() + "\n" +
                (folder_ / "imu.yaml").string() + "\n");
  const std::string file = (folder_ / "mine.yaml").string();
  const Outcome outcome = Selfcal({"calibrations",
                                   "export",
                                   "device",
                                   "--format",
                                   "maplab",
                                   "--output",
                                   file});
  EXPECT_EQ(outcome.out, file + "\n");
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/active");
  EXPECT_THAT(outcome.err, Not(HasSubstr("saturation")));
  EXPECT_TRUE(fs::exists(file));
}

TEST_F(CalibrationExport, StrictWritesNothingThatPredictsOtherwise) {
  std::vector<std::string> line = Line("maplab");
  line.push_back("--strict");
  const Outcome outcome = Selfcal(line);
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err, HasSubstr("nothing was written"));
  EXPECT_FALSE(fs::exists(folder_));
  // Kalibr loses the sigmas alone, of which no prediction is made.
  line = Line("kalibr");
  line.push_back("--strict");
  EXPECT_EQ(Selfcal(line).code, 0);
}

TEST_F(CalibrationExport, OverwritesOnlyWhenTold) {
  std::vector<std::string> line = Line("kalibr");
  EXPECT_EQ(Selfcal(line).code, 0);
  fs::remove(folder_ / "camchain-imucam.yaml");
  const Outcome refused = Selfcal(line);
  EXPECT_EQ(refused.code, 2) << "as for every other command that writes files";
  EXPECT_THAT(refused.err, HasSubstr("--force"));
  EXPECT_FALSE(fs::exists(folder_ / "camchain-imucam.yaml")) << "all or none";
  line.push_back("--force");
  EXPECT_EQ(Selfcal(line).code, 0);
}

TEST_F(CalibrationExport, JsonHasFilesAndLosses) {
  std::vector<std::string> line = Line("maplab");
  line.push_back("--json");
  const auto message = Parse<google::protobuf::Struct>(Selfcal(line).out);
  EXPECT_EQ(message.fields().at("files").list_value().values_size(), 1);
  const auto& loss = message.fields()
                         .at("losses")
                         .list_value()
                         .values(0)
                         .struct_value()
                         .fields();
  EXPECT_EQ(loss.at("name").string_value(), "imu");
  EXPECT_TRUE(loss.at("changes_prediction").bool_value());
}

TEST_F(CalibrationExport, AModelThatTheToolLacksIsAnError) {
  for (const char* tool : {"openvins", "basalt"}) {
    const Outcome outcome = Selfcal(Line(tool));
    EXPECT_EQ(outcome.code, 1);
    EXPECT_THAT(outcome.err, HasSubstr("distortion model fov"));
  }
  EXPECT_FALSE(fs::exists(folder_));
  EXPECT_EQ(Selfcal(Line("okvis")).code, 2);
  daemon_.rigs.clear();
  EXPECT_EQ(Selfcal(Line("kalibr")).code, 1);
}

TEST_F(CalibrationExport, ARigIsCreatedFromWhatWasWritten) {
  ASSERT_EQ(Selfcal(Line("kalibr")).code, 0);
  const std::string chain = (folder_ / "camchain-imucam.yaml").string();
  const std::string imu = (folder_ / "imu.yaml").string();
  const Outcome outcome = Selfcal({"rig",
                                   "create",
                                   "--from",
                                   "kalibr",
                                   imu,
                                   chain,
                                   "--id",
                                   "again",
                                   "--accel-noise",
                                   "0.5",
                                   "--strict"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  ASSERT_EQ(daemon_.rigs.size(), 2u);
  const v1::Rig& rig = daemon_.rigs[1];
  EXPECT_EQ(rig.name(), "rigs/again");
  EXPECT_EQ(rig.groups_size(), 0);
  EXPECT_EQ(rig.imu_noise().accel_noise_density(), 0.5);
  EXPECT_EQ(rig.factory().cameras(0).f().x(), 257.5);
  EXPECT_NEAR(rig.factory().imu().s_g().x(), 1.01, 1e-12);
}

TEST_F(CalibrationExport, FilesThatCannotBeReadAreUnusableInput) {
  const Outcome missing =
      Selfcal({"rig", "create", "--from", "kalibr", "/nowhere", "--id", "a"});
  EXPECT_EQ(missing.code, 2);
  EXPECT_THAT(missing.err, HasSubstr("cannot read /nowhere"));
  const std::string file = WriteFile("cam0: {}\n");
  const Outcome partial =
      Selfcal({"rig", "create", "--from", "kalibr", file, "--id", "a"});
  EXPECT_EQ(partial.code, 2);
  EXPECT_THAT(partial.err, HasSubstr(file + ": give two files"));
  const Outcome two = Selfcal({"rig", "create", file, file});
  EXPECT_EQ(two.code, 2);
  EXPECT_THAT(two.err, HasSubstr("--from"));
  EXPECT_EQ(daemon_.rigs.size(), 1u);
}

TEST_F(CalibrationExport, WhatARigCannotTakeIsNamedAndStrictRefusesIt) {
  ASSERT_EQ(Selfcal(Line("kalibr")).code, 0);
  const fs::path imu = folder_ / "imu.yaml";
  std::string text = ReadBytes(imu);
  // Positions of the axes of an accelerometer whose axes are not orthogonal.
  const std::string zero = "\n  - [0.0,";
  const std::size_t row = text.find(zero, text.find("accelerometers:"));
  text.replace(row, zero.size(), "\n  - [0.01,");
  text.insert(text.find("gyroscopes:"), "  rx_i: [0.01, 0, 0]\n");
  std::ofstream(imu) << text;
  std::vector<std::string> line = {"rig",
                                   "create",
                                   "--from",
                                   "kalibr",
                                   imu.string(),
                                   (folder_ / "camchain-imucam.yaml").string(),
                                   "--id",
                                   "again"};
  const Outcome told = Selfcal(line);
  EXPECT_EQ(told.code, 0);
  EXPECT_THAT(told.err, HasSubstr("lost: accelerometers.M: "));
  line.push_back("--strict");
  const Outcome refused = Selfcal(line);
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("no rig was created"));
  EXPECT_EQ(daemon_.rigs.size(), 2u);
}

}  // namespace
}  // namespace selfcal::client
