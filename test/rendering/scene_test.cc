#include "test/rendering/scene.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace selfcal {
namespace {

Scene PlainScene() {
  Scene scene{Texture(0, 1, {255}), {}, {}, {}};
  scene.room.half_m = {4, 3, 2};
  return scene;
}

TEST(Scene, RayMeetsTheWallOfARoomWhereItsPlaneIs) {
  const Scene scene = PlainScene();
  const Eigen::Vector3d p(0.5, -1, 0.2);
  const Eigen::Vector3d d = Eigen::Vector3d(1, 0.2, 0.1).normalized();
  const auto hit = Cast(scene, p, d, 0);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->surface, 0);
  const Eigen::Vector3d expected(4, -1 + 3.5 * 0.2, 0.2 + 3.5 * 0.1);
  EXPECT_LT((PointAt(scene, *hit, 0) - expected).norm(), 1e-12);
  EXPECT_NEAR(hit->distance_m, (expected - p).norm(), 1e-12);
}

TEST(Scene, RayMeetsTheNearestBox) {
  Scene scene = PlainScene();
  Box box;
  box.half_m.setConstant(0.5);
  box.centre_G = {3, 0, 0};
  scene.boxes.push_back(box);
  box.centre_G = {1.5, 0, 0};
  // A corner points along the ray.
  box.yaw_rad = std::numbers::pi / 4;
  scene.boxes.push_back(box);
  const auto hit = Cast(scene, {0, 1e-9, 0}, {1, 0, 0}, 0);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->surface, 2);
  EXPECT_NEAR(hit->distance_m, 1.5 - 0.5 * std::numbers::sqrt2, 1e-8);
  const auto beside = Cast(scene, {0, 0.9, 0}, {1, 0, 0}, 0);
  ASSERT_TRUE(beside);
  EXPECT_EQ(beside->surface, 0);
}

TEST(Scene, PointOfAMovingBoxMovesWithIt) {
  Scene scene = PlainScene();
  Box box;
  box.half_m.setConstant(0.5);
  box.centre_G = {2, 0, 0};
  box.sway_G = {0.4, 0.3, 0};
  box.period_s = 4;
  scene.boxes.push_back(box);
  const auto hit = Cast(scene, Eigen::Vector3d::Zero(), {1, 0, 0}, 0);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->surface, 1);
  // A quarter of the period later the sway is complete.
  const Eigen::Vector3d moved =
      PointAt(scene, *hit, 1) - PointAt(scene, *hit, 0);
  EXPECT_LT((moved - box.sway_G).norm(), 1e-12);
}

TEST(Scene, RoomSurroundsThePathAndItsBoxesAreApartFromIt) {
  for (int seed = 1; seed <= 5; ++seed) {
    const auto trajectory = MakeHandheld(30, 1, seed);
    SceneOptions options;
    options.moving_boxes = 3;
    const Scene scene = MakeRoom(*trajectory, options, seed);
    EXPECT_EQ(scene.boxes.size(), 17u);
    EXPECT_EQ(std::count_if(scene.boxes.begin(),
                            scene.boxes.end(),
                            [](const Box& box) { return box.moves(); }),
              3);
    for (double t_s = 0; t_s < 30; t_s += 0.11) {
      const Eigen::Vector3d p = trajectory->At(t_s).p_GI;
      const Eigen::Array3d from_walls =
          scene.room.half_m - (p - scene.room.centre_G).cwiseAbs();
      EXPECT_GT(from_walls.minCoeff(), options.wall_distance_m - 0.02);
      for (const Box& box : scene.boxes) {
        const Eigen::Vector3d q =
            box.Rotation().transpose() * (p - box.CentreAt(t_s));
        const double apart = (q.cwiseAbs() - box.half_m).cwiseMax(0).norm();
        // The path is sampled, and walked at some m/s.
        EXPECT_GT(apart, options.clearance_m - 0.05);
      }
    }
  }
}

TEST(Scene, MovingBoxesReachTheirSpeed) {
  SceneOptions options;
  options.moving_boxes = 3;
  options.moving_speed_mps = 0.7;
  const Scene scene = MakeRoom(*MakeHandheld(20, 1, 3), options, 3);
  for (const Box& box : scene.boxes) {
    if (!box.moves()) continue;
    double fastest = 0;
    for (double t_s = 0; t_s < box.period_s; t_s += 1e-3) {
      fastest = std::max(
          fastest,
          (box.CentreAt(t_s + 1e-4) - box.CentreAt(t_s)).norm() / 1e-4);
    }
    EXPECT_NEAR(fastest, 0.7, 1e-3);
  }
}

}  // namespace
}  // namespace selfcal
