#include "server/encode/encode_activity.h"

#include <gtest/gtest.h>

namespace selfcal::server {
namespace {

constexpr std::int64_t kTime = 1'700'000'000'500'000'000;

TEST(EncodeActivity, HasTheReportsOfTheDevice) {
  RigSummary rig;
  rig.rig = "tablet";
  rig.device = {.time_ns = kTime, .waiting = 12, .program_version = "1.2.3"};
  const v1::RigActivity message = Encode(rig, kTime);
  EXPECT_FALSE(message.has_uplink());
  ASSERT_TRUE(message.has_device());
  EXPECT_EQ(message.device().time().seconds(), 1'700'000'000);
  EXPECT_EQ(message.device().time().nanos(), 500'000'000);
  EXPECT_EQ(message.device().waiting(), 12);
  EXPECT_EQ(message.device().program_version(), "1.2.3");
}

TEST(EncodeActivity, HasNoTimeOfADeviceThatHasNotReportedYet) {
  RigSummary rig;
  rig.rig = "tablet";
  rig.uplink = {.time_ns = 0, .waiting = 4, .program_version = ""};
  const v1::RigActivity message = Encode(rig, kTime);
  EXPECT_FALSE(message.has_device());
  ASSERT_TRUE(message.has_uplink());
  EXPECT_FALSE(message.uplink().has_time());
  EXPECT_EQ(message.uplink().waiting(), 4);
}

TEST(EncodeActivity, HasNoReportsOfARigWithoutAHub) {
  RigSummary rig;
  rig.rig = "tablet";
  const v1::RigActivity message = Encode(rig, kTime);
  EXPECT_FALSE(message.has_device());
  EXPECT_FALSE(message.has_uplink());
}

}  // namespace
}  // namespace selfcal::server
