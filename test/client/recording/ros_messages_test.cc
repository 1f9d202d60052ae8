// Messages that are as they should be are in containers_test.cc, by writers of
// others.
#include "client/recording/ros_messages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>

namespace selfcal::client {
namespace {

template <typename T>
std::string Bytes(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

// The header of ROS 1.
std::string Header(std::uint32_t seconds, std::uint32_t rest_ns) {
  return Bytes<std::uint32_t>(9) + Bytes(seconds) + Bytes(rest_ns) +
         Bytes<std::uint32_t>(3) + "imu";
}

std::string Imu(double accel_z) {
  std::string bytes = Header(12, 34);
  for (int i = 0; i < 4 + 9; ++i) bytes += Bytes(0.5);
  for (int i = 0; i < 3; ++i) bytes += Bytes(1.0 + i);
  for (int i = 0; i < 9; ++i) bytes += Bytes(0.5);
  bytes += Bytes(4.0) + Bytes(5.0) + Bytes(accel_z);
  for (int i = 0; i < 9; ++i) bytes += Bytes(0.5);
  return bytes;
}

TEST(RosMessages, ReadingHasItsFields) {
  const auto sample = ParseImu(Wire::kRos1, Imu(6));
  ASSERT_TRUE(sample.ok()) << sample.status();
  EXPECT_EQ(sample->t_ns, 12'000'000'034);
  EXPECT_EQ(sample->gyro, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(sample->accel, Eigen::Vector3d(4, 5, 6));
}

TEST(RosMessages, ReadingThatIsNotFiniteIsReported) {
  for (const double value : {std::nan(""), HUGE_VAL}) {
    EXPECT_EQ(ParseImu(Wire::kRos1, Imu(value)).status().message(),
              "the reading is not finite");
  }
}

TEST(RosMessages, ThoseThatAreCutOffAnywhereAreReported) {
  const std::string whole = Imu(6);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(ParseImu(Wire::kRos1, whole.substr(0, size)).ok()) << size;
  }
}

TEST(RosMessages, ImpossibleStampsAreReported) {
  EXPECT_TRUE(ParseStamp(Wire::kRos1, Header(1, 999'999'999)).ok());
  EXPECT_FALSE(ParseStamp(Wire::kRos1, Header(1, 1'000'000'000)).ok());
  const std::string cdr("\0\1\0\0", 4);
  const auto stamp = [&](std::int32_t seconds) {
    return ParseStamp(Wire::kCdr,
                      cdr + Bytes(seconds) + Bytes<std::uint32_t>(5));
  };
  EXPECT_EQ(stamp(std::numeric_limits<std::int32_t>::max()).value(),
            2'147'483'647'000'000'005);
  EXPECT_FALSE(stamp(-1).ok());
}

TEST(RosMessages, EncodingsOtherThanPlainCdrAreReported) {
  const std::string fields = Bytes<std::int32_t>(1) + Bytes<std::uint32_t>(5);
  EXPECT_TRUE(ParseStamp(Wire::kCdr, std::string("\0\1\0\0", 4) + fields).ok());
  for (const char kind : {'\2', '\3', '\7', '\xff'}) {
    const std::string head = {'\0', kind, '\0', '\0'};
    EXPECT_FALSE(ParseStamp(Wire::kCdr, head + fields).ok());
  }
  EXPECT_FALSE(ParseStamp(Wire::kCdr, "").ok());
}

// A length of 4 GiB of numbers must not be allocated.
TEST(RosMessages, LengthsThatAreTooLongAreReported) {
  const std::string header = Header(1, 2);
  const std::string huge = Bytes<std::uint32_t>(0xffffffff);
  EXPECT_FALSE(ParseCameraInfo(Wire::kRos1,
                               header + Bytes<std::uint64_t>(0) +
                                   Bytes<std::uint32_t>(0) + huge)
                   .ok());
  EXPECT_FALSE(
      ParseCompressedImage(Wire::kRos1, header + Bytes<std::uint32_t>(0) + huge)
          .ok());
}

}  // namespace
}  // namespace selfcal::client
