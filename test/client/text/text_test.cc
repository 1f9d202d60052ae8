#include "client/text/text.h"

#include <gtest/gtest.h>

#include <limits>

namespace selfcal::client {
namespace {

TEST(ValueText, HasTheDecimalsOfTwoDigitsOfSigma) {
  EXPECT_EQ(ValueText(255.123456, 0.034), "255.123");
  EXPECT_EQ(ValueText(255.123456, 3.4), "255.1");
  EXPECT_EQ(ValueText(255.123456, 340), "255");
  EXPECT_EQ(ValueText(0.00123456, 1.2e-5), "0.001235");
  EXPECT_EQ(ValueText(0.00123456, 1e-30), "0.001234560");
}

TEST(ValueText, HasSixDigitsWithoutASigma) {
  EXPECT_EQ(ValueText(255.123456, 0), "255.123");
  EXPECT_EQ(ValueText(1, std::numeric_limits<double>::quiet_NaN()), "1");
  EXPECT_EQ(ValueText(std::numeric_limits<double>::infinity(), 1), "inf");
}

TEST(SigmaText, HasTwoDigits) {
  EXPECT_EQ(SigmaText(0.03456), "0.035");
  EXPECT_EQ(SigmaText(0), "-") << "nothing was estimated";
}

TEST(CountText, HasThePluralForAllButOne) {
  EXPECT_EQ(CountText(0, "segment"), "0 segments");
  EXPECT_EQ(CountText(1, "segment"), "1 segment");
  EXPECT_EQ(CountText(2, "segment"), "2 segments");
  EXPECT_EQ(CountText(1, "entry", "entries"), "1 entry");
  EXPECT_EQ(CountText(2, "entry", "entries"), "2 entries");
}

TEST(BytesText, HasAUnit) {
  EXPECT_EQ(BytesText(999), "999 B");
  EXPECT_EQ(BytesText(1234), "1.2 kB");
  EXPECT_EQ(BytesText(12'345'678), "12.3 MB");
}

TEST(TimeText, IsUtc) {
  google::protobuf::Timestamp time;
  EXPECT_EQ(TimeText(time), "-");
  time.set_seconds(1'700'000'000);
  EXPECT_EQ(TimeText(time), "2023-11-14 22:13:20");
  time.set_seconds(std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(TimeText(time), "-");
}

TEST(StateText, IsInWords) {
  EXPECT_EQ(StateText(v1::Calibration::SUPERSEDED), "superseded");
  EXPECT_EQ(StateText(v1::Segment::STATE_UNSPECIFIED), "unknown");
  EXPECT_EQ(TriggerText(v1::Recalibration::TABLES_FULL), "tables full");
  EXPECT_EQ(StateText(static_cast<v1::Segment::State>(99)), "unknown");
}

v1::UnobservedDirection Direction(
    std::initializer_list<std::pair<const char*, double>> parts) {
  v1::UnobservedDirection direction;
  for (const auto& [component, weight] : parts) {
    auto* part = direction.add_parts();
    part->set_component(component);
    part->set_weight(weight);
  }
  direction.set_information_ratio(0.123);
  return direction;
}

TEST(DirectionText, NamesASingleComponentAlone) {
  EXPECT_EQ(DirectionText(Direction(
                {{"imu.gyro.scale.x", -0.999}, {"imu.gyro.scale.y", 0.04}})),
            "imu.gyro.scale.x (information of the data: 0.12 of the prior's)");
}

TEST(DirectionText, WritesACombinationAsASum) {
  EXPECT_EQ(DirectionText(Direction(
                {{"a", -0.8}, {"b", -0.5}, {"c", 0.33}, {"d", 0.05}})),
            "-0.80 a - 0.50 b + 0.33 c (information of the data: 0.12 of the "
            "prior's)");
}

TEST(DirectionText, SaysSomethingAboutNothing) {
  EXPECT_EQ(DirectionText(Direction({})),
            "unnamed (information of the data: 0.12 of the prior's)");
}

TEST(LastPart, IsTheIdOfAName) {
  EXPECT_EQ(LastPart("rigs/a/segments/walk~3"), "walk~3");
  EXPECT_EQ(LastPart("walk~3"), "walk~3");
}

}  // namespace
}  // namespace selfcal::client
