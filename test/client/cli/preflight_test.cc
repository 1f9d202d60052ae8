// selfcal preflight, and what import says of it.
#include <gmock/gmock.h>
#include <google/protobuf/struct.pb.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "client/import/vi_map.h"
#include "test/client/cli/commands_fixture.h"
#include "test/recordings.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

// The rig of a recording, calibrated for images of twice the size.
Rig DoubleSize(const std::string& map) {
  Rig rig = ReadViMap(map, {})->rig;
  rig.id = "device";
  for (CameraCalibration& camera : rig.factory.cameras) {
    camera.f *= 2;
    camera.c *= 2;
    camera.width_px *= 2;
    camera.height_px *= 2;
  }
  return rig;
}

class PreflightCommand : public Commands {
 protected:
  static std::string WriteRig(const Rig& rig) {
    std::string json;
    EXPECT_TRUE(
        google::protobuf::util::MessageToJsonString(ToProto(rig), &json).ok());
    return WriteFile(json);
  }
};

TEST_F(PreflightCommand, FindsNothingWrongInARecording) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  const Outcome outcome = Selfcal({"preflight", map});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, StartsWith("checked\tdropped and repeated samples"));
  EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '\n'), 5);
}

TEST_F(PreflightCommand, NamesWhatIsWrongAndExitsWithOne) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  const std::string rig = WriteRig(DoubleSize(map));
  const Outcome outcome = Selfcal({"preflight", map, "--rig", rig});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.out,
              StartsWith("focal-length\tcam0: the intrinsics are of another "
                         "resolution: the pixels are 0.5 times"));
  EXPECT_THAT(outcome.out, HasSubstr("\tmultiply focal length"));
}

TEST_F(PreflightCommand, PrintsOneDocumentOfJson) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  const std::string rig = WriteRig(DoubleSize(map));
  const Outcome outcome = Selfcal({"preflight", map, "--rig", rig, "--json"});
  EXPECT_EQ(outcome.code, 1);
  const auto document = Parse<google::protobuf::Struct>(outcome.out);
  const auto& fields = document.fields();
  ASSERT_EQ(fields.at("findings").list_value().values_size(), 1);
  const auto& finding =
      fields.at("findings").list_value().values(0).struct_value().fields();
  EXPECT_EQ(finding.at("kind").string_value(), "focal-length");
  EXPECT_NEAR(finding.at("value").number_value(), 0.5, 1e-3);
  EXPECT_NE(finding.at("cause").string_value(), "");
  EXPECT_NE(finding.at("remedy").string_value(), "");
  EXPECT_EQ(fields.at("checked").list_value().values_size(), 5);
  EXPECT_EQ(fields.at("not_checked").list_value().values_size(), 0);
}

TEST_F(PreflightCommand, ExitsWithTwoForWhatItCannotRead) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  EXPECT_EQ(Selfcal({"preflight", "/nowhere"}).code, 2);
  Rig rig = DoubleSize(map);
  rig.factory.cameras[0].f.x() = -1;
  const Outcome outcome = Selfcal({"preflight", map, "--rig", WriteRig(rig)});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("factory.cameras[0].f"));
}

TEST_F(PreflightCommand, IsRunByImportWhichWarnsAndSends) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  daemon_.rigs.push_back(ToProto(DoubleSize(map)));
  const Outcome outcome = Selfcal({"import", "device", map});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err,
              StartsWith("selfcal: warning: focal-length: cam0: the "
                         "intrinsics are of another resolution"));
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
  EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '\n'), 14);
}

TEST_F(PreflightCommand, OfImportTakesTheVersionThatTheMapWasMadeWith) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  daemon_.rigs.push_back(ToProto(DoubleSize(map)));
  v1::Calibration version = Version(2);
  *version.mutable_parameters() = ToProto(ReadViMap(map, {})->rig.factory);
  daemon_.calibrations.push_back(version);
  const Outcome outcome =
      Selfcal({"import", "device", map, "--calibration-version", "2"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(daemon_.last_name, "rigs/device/calibrations/2");
}

}  // namespace
}  // namespace selfcal::client
