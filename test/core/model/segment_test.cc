#include "core/model/segment.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "core/model/so3.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

TEST(KeyframeState, BoxPlusTurnsOnTheRightAndAddsTheRest) {
  RandomValues random(1);
  for (int i = 0; i < 1000; ++i) {
    KeyframeState x;
    x.t_ns = i;
    x.q_GI = random.Rotation();
    x.p_GI = random.Vector(3, 10);
    x.v_GI = random.Vector(3, 10);
    x.b_a = random.Vector(3, 1);
    x.b_g = random.Vector(3, 1);
    const Eigen::Matrix<double, 15, 1> delta = random.Vector(15, 1);
    const KeyframeState moved = BoxPlus(x, delta);
    EXPECT_EQ(moved.t_ns, x.t_ns);
    EXPECT_NEAR(moved.q_GI.norm(), 1, 1e-15);
    EXPECT_LT((Log(x.q_GI.conjugate() * moved.q_GI) -
               delta.segment<3>(kStateRotation))
                  .norm(),
              1e-14);
    EXPECT_EQ(moved.p_GI, x.p_GI + delta.segment<3>(kStatePosition));
    EXPECT_EQ(moved.v_GI, x.v_GI + delta.segment<3>(kStateVelocity));
    EXPECT_EQ(moved.b_a, x.b_a + delta.segment<3>(kStateAccelBias));
    EXPECT_EQ(moved.b_g, x.b_g + delta.segment<3>(kStateGyroBias));
  }
}

// The expectation looks at each sample.
TEST(SamplesBetweenKeyframes, AreThoseThatNoOtherSegmentHas) {
  MotionSegment segment;
  for (int t = 0; t < 100; t += 5) segment.imu.push_back({t});
  const auto times = [&] {
    std::vector<std::int64_t> all;
    for (const ImuSample& sample : SamplesBetweenKeyframes(segment)) {
      all.push_back(sample.t_ns);
    }
    return all;
  };
  EXPECT_EQ(times().size(), segment.imu.size()) << "no keyframe";
  segment.keyframes.resize(2);
  segment.keyframes[0].t_ns = 22;
  segment.keyframes[1].t_ns = 33;
  EXPECT_EQ(times(), (std::vector<std::int64_t>{20, 25, 30, 35}));
  segment.keyframes[0].t_ns = 20;
  segment.keyframes[1].t_ns = 30;
  EXPECT_EQ(times(), (std::vector<std::int64_t>{20, 25, 30}));
  // A segment that is not valid: as far as there are samples.
  segment.keyframes[0].t_ns = -7;
  segment.keyframes[1].t_ns = 200;
  EXPECT_EQ(times().size(), segment.imu.size());
  segment.keyframes[0].t_ns = 300;
  EXPECT_EQ(times(), (std::vector<std::int64_t>{95}));
  segment.imu.clear();
  EXPECT_TRUE(times().empty());
}

}  // namespace
}  // namespace selfcal
