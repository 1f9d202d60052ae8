#include "core/calibration/landmark_position.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// One keyframe at the origin of G, with one camera.
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

// This holds however small the components of the homogeneous point are.
TEST_F(OneView, NothingIsObservedInTheCentreOfACamera) {
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

TEST_F(OneView, APointAtInfinityIsObserved) {
  EXPECT_TRUE(Projects({0.1, -0.2, 1, 0}));
  EXPECT_FALSE(Projects({0.1, -0.2, -1, 0}));
}

// Two views of a point 2 m away, half a metre apart.
class TwoViews : public ::testing::Test {
 protected:
  TwoViews() {
    rig_.factory.cameras[0].q_CI.setIdentity();
    rig_.factory.cameras[0].p_CI.setZero();
    keyframes_[1].p_GI = {0.5, 0, 0};
  }

  // The track of a point, with the baseline reversed if the point is mirrored.
  Track Seen(const Eigen::Vector4d& point_G) const {
    const LandmarkScene scene(rig_.factory, keyframes_, motions_, 1);
    Track track;
    for (int k = 0; k < 2; ++k) {
      TrackObservation seen{.keyframe = k, .camera = 0, .z_px = {0, 0}};
      EXPECT_TRUE(scene.Residual(seen, point_G, &seen.z_px, nullptr));
      track.observations.push_back(seen);
    }
    return track;
  }

  RefinedPosition Refine(const Track& track, const Eigen::Vector4d& from_G) {
    const LandmarkScene scene(rig_.factory, keyframes_, motions_, 1);
    position_ = PositionAt(scene, track, from_G);
    return RefinePosition(
        scene, track, AllOf(track), {.kind = LossKind::kNone}, {}, &position_);
  }

  Rig rig_ = HandheldRig("r");
  std::vector<KeyframeState> keyframes_ = std::vector<KeyframeState>(2);
  const KeyframeMotions motions_;
  LandmarkPosition position_;
};

TEST_F(TwoViews, APointInFrontIsFound) {
  const Eigen::Vector4d point(0.1, 0.2, 2, 1);
  EXPECT_FALSE(Refine(Seen(point), {0.1, 0.2, 5, 1}).behind);
  EXPECT_TRUE(position_.Homogeneous().hnormalized().isApprox(
      point.hnormalized(), 1e-3));
}

// A mirrored point, as a reversed lever arm makes of all points, has the same
// rays and lies beyond infinity.
TEST_F(TwoViews, AMirroredPointIsHeldNearInfinity) {
  const Eigen::Vector4d mirrored(0.1, 0.2, 2, -1);
  const RefinedPosition refined = Refine(Seen(mirrored), {0.1, 0.2, 20, 1});
  EXPECT_TRUE(refined.behind);
  const double sigma = std::sqrt(refined.information.inverse()(2, 2));
  EXPECT_GT(position_.inverse_depth.z(), -2.5 * sigma);
  EXPECT_GT(refined.cost, 100);
  // Also from the position to which its residuals pull it.
  EXPECT_TRUE(Refine(Seen(mirrored), mirrored).behind);
  EXPECT_GT(position_.inverse_depth.z(), -2.5 * sigma);
}

}  // namespace
}  // namespace selfcal
