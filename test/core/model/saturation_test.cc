#include "core/model/saturation.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

namespace selfcal {
namespace {

// A hundred readings well within the range.
MotionSegment Calm() {
  MotionSegment segment;
  for (int k = 0; k < 100; ++k) {
    segment.imu.push_back({k, {0.1, -0.2, 0.3}, {0.5, 9.8, -0.1}});
  }
  return segment;
}

TEST(Saturation, DefaultIsASensorOf2000DegreesAnd16G) {
  const ImuFullScale full_scale;
  EXPECT_NEAR(full_scale.gyro_radps, 2000 * std::numbers::pi / 180, 1e-6);
  EXPECT_NEAR(full_scale.accel_mps2, 16 * 9.80665, 1e-3);
}

TEST(Saturation, ReadingsAtOrBeyondTheFullScaleAreRemoved) {
  const ImuFullScale full_scale{10, 50};
  MotionSegment segment = Calm();
  segment.imu[3].gyro.y() = -10;
  segment.imu[50].accel.z() = 999;
  segment.imu[51].gyro.x() = std::numeric_limits<double>::infinity();
  segment.imu[70].gyro.x() = 9.999;
  segment.imu[71].accel.x() = -49.999;
  EXPECT_EQ(CountSaturatedReadings(segment.imu, full_scale), 2u);
  RemoveSaturatedReadings(full_scale, &segment.imu);
  ASSERT_EQ(segment.imu.size(), 98u);
  EXPECT_EQ(CountSaturatedReadings(segment.imu, full_scale), 0u);
  EXPECT_EQ(segment.imu[3].t_ns, 4);
  EXPECT_EQ(segment.imu[49].t_ns, 51);
}

TEST(Saturation, MoreThanOneInFiftyIsNoShock) {
  EXPECT_FALSE(IsTooSaturated(Calm().imu, 2));
  EXPECT_TRUE(IsTooSaturated(Calm().imu, 3));
  EXPECT_FALSE(IsTooSaturated({}, 0));
}

}  // namespace
}  // namespace selfcal
