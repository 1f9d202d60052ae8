#include "core/model/segment.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace selfcal
