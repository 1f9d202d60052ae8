#include "core/calibration/landmark_place.h"

#include <gtest/gtest.h>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// One keyframe at the origin of G, seen from by one camera.
class OneView : public ::testing::Test {
 protected:
  static Rig MakeRig() {
    Rig rig = HandheldRig("r");
    rig.factory.cameras[0].q_CI.setIdentity();
    rig.factory.cameras[0].p_CI.setZero();
    return rig;
  }

  bool Projects(const Eigen::Vector4d& point_G) const {
    Eigen::Vector2d residual_px;
    return scene_.Residual({.keyframe = 0, .camera = 0, .z_px = {320, 240}},
                           point_G,
                           &residual_px,
                           nullptr);
  }

  const Rig rig_ = MakeRig();
  const std::vector<KeyframeState> keyframes_ =
      std::vector<KeyframeState>(1, KeyframeState{});
  const KeyframeMotions motions_;
  const LandmarkScene scene_{rig_.factory, keyframes_, motions_, 1};
};

// However small the numbers that a homogeneous point is given by.
TEST_F(OneView, NothingIsSeenInTheCentreOfACamera) {
  const Eigen::Vector3d ray(0.1, -0.2, 1);
  const Eigen::Vector3d unit = ray.normalized();
  for (const double scale : {1e-6, 1.0, 1e6}) {
    const auto at = [&](double distance_m) -> Eigen::Vector4d {
      return scale * (distance_m * unit).homogeneous();
    };
    EXPECT_FALSE(Projects(at(3e-7)));
    EXPECT_FALSE(Projects(at(0.9 * kMinDistance_m)));
    EXPECT_TRUE(Projects(at(1.1 * kMinDistance_m)));
  }
}

TEST_F(OneView, WhatIsAtInfinityIsSeen) {
  EXPECT_TRUE(Projects({0.1, -0.2, 1, 0}));
  EXPECT_FALSE(Projects({0.1, -0.2, -1, 0}));
}

}  // namespace
}  // namespace selfcal
