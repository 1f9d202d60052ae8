#include "core/model/second_imu.h"

#include <gtest/gtest.h>

#include "core/model/so3.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

KeyframeState RandomState(RandomValues& random) {
  KeyframeState x;
  x.q_GI = random.Rotation();
  x.p_GI = random.Vector(3, 5);
  x.v_GI = random.Vector(3, 2);
  x.v_GJ = random.Vector(3, 2);
  x.b_a1 = random.Vector(3, 0.1);
  x.b_g1 = random.Vector(3, 0.1);
  return x;
}

Eigen::Matrix<double, 6, 1> PoseDifference(const KeyframeState& a,
                                           const KeyframeState& b) {
  Eigen::Matrix<double, 6, 1> difference;
  difference << Log(b.q_GI.conjugate() * a.q_GI), a.p_GI - b.p_GI;
  return difference;
}

TEST(SecondImu, ItsFrameIsWhereItsMountPutsIt) {
  RandomValues random(1);
  for (int trial = 0; trial < 100; ++trial) {
    Calibration theta = random.ThetaOfTwoImus();
    theta.imu1->time_offset_s = 3e-3;
    const KeyframeState x = RandomState(random);
    const KeyframeState y = StateOfImu(theta, 1, x);
    // A point of the world, seen from J directly and by way of I.
    const Eigen::Vector3d p_G = random.Vector(3, 3);
    const Eigen::Vector3d p_I = x.q_GI.conjugate() * (p_G - x.p_GI);
    const Eigen::Vector3d p_J = theta.imu1->q_JI * p_I + theta.imu1->p_JI;
    EXPECT_LT((y.q_GI.conjugate() * (p_G - y.p_GI) - p_J).norm(), 1e-12);
    EXPECT_EQ(y.t_ns, x.t_ns - 3'000'000);
    EXPECT_EQ(y.v_GI, x.v_GJ);
    EXPECT_EQ(y.b_a, x.b_a1);
    EXPECT_EQ(y.b_g, x.b_g1);
  }
}

TEST(SecondImu, DerivativesOfItsPoseMatchDifferences) {
  RandomValues random(2);
  constexpr double kStep = 1e-6;
  for (int trial = 0; trial < 100; ++trial) {
    const Calibration theta = random.ThetaOfTwoImus();
    const KeyframeState x = RandomState(random);
    const MountDerivatives by = DerivativesOfMount(*theta.imu1, x);
    const int mount = LinkTangentSize(theta) - kMountTangentSize;
    const auto at = [&](const Calibration& c, const KeyframeState& s) {
      return StateOfImu(c, 1, s);
    };
    for (int i = 0; i < 6; ++i) {
      const Eigen::VectorXd d = kStep * Eigen::VectorXd::Unit(24, i);
      const auto by_pose =
          PoseDifference(at(theta, BoxPlus(x, d)), at(theta, BoxPlus(x, -d)));
      EXPECT_LT((by_pose / (2 * kStep) - by.by_pose.col(i)).norm(), 1e-7);
      const Eigen::VectorXd m =
          kStep * Eigen::VectorXd::Unit(TangentSize(theta), mount + i);
      const auto by_mount =
          PoseDifference(at(BoxPlus(theta, m), x), at(BoxPlus(theta, -m), x));
      EXPECT_LT((by_mount / (2 * kStep) - by.by_mount.col(i)).norm(), 1e-7);
    }
  }
}

}  // namespace
}  // namespace selfcal
