// selfcal segment preflight, and what segment import says of it.
#include <gmock/gmock.h>
#include <google/protobuf/struct.pb.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "client/cli/vi_map_input.h"
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
  std::string WriteRig(const Rig& rig) const {
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
  EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '\n'), 7);
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
  EXPECT_EQ(fields.at("checked").list_value().values_size(), 6);
  // The shutter, before the focal length is correct.
  EXPECT_EQ(fields.at("not_checked").list_value().values_size(), 1);
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

// The segments that the daemon keeps of the device, as the recording has them.
TEST_F(PreflightCommand, LooksAtWhatADeviceHasSent) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  ViMapInput input;
  input.folders = {map};
  const auto recording = ReadViMapSegments(input);
  ASSERT_TRUE(recording.ok()) << recording.status();
  Rig rig = recording->rig;
  rig.id = "device";
  daemon_.rigs.push_back(ToProto(rig));
  const Outcome nothing = Selfcal({"preflight", "--device", "device"});
  EXPECT_EQ(nothing.code, 1);
  EXPECT_THAT(nothing.err, HasSubstr("send segments from the device"));
  for (MotionSegment segment : recording->segments) {
    segment.calibration_version = 2;
    v1::Segment listed;
    listed.set_name("rigs/device/segments/" + segment.key.session + "~" +
                    std::to_string(segment.key.index));
    listed.set_calibration_version(2);
    daemon_.segments.push_back(listed);
    daemon_.data.push_back(ToProto(segment));
  }
  daemon_.data.pop_back();  // dropped since
  v1::Calibration version = Version(2);
  *version.mutable_parameters() = ToProto(rig.factory);
  daemon_.calibrations.push_back(version);
  const Outcome good = Selfcal({"preflight", "--device", "device"});
  EXPECT_EQ(good.code, 0) << good.err << good.out;
  EXPECT_EQ(daemon_.last_filter, "has_data = true AND calibration_version = 2");
  EXPECT_THAT(good.out, StartsWith("checked\tdropped and repeated samples"));
  *daemon_.calibrations[0].mutable_parameters() =
      ToProto(DoubleSize(map).factory);
  const Outcome bad = Selfcal({"preflight", "--device", "device"});
  EXPECT_EQ(bad.code, 1);
  EXPECT_THAT(bad.out, StartsWith("focal-length\tcam0"));
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
