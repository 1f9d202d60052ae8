#include "core/model/camera_equidistant.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr int kEquidistantTrials = 3000;
constexpr PixelMap kEquidistantPlane = {{1, 1}, {0, 0}};
using Coefficients = std::array<double, 4>;

Eigen::Vector3d AtAngle(double theta, const Eigen::Vector2d& direction) {
  return {std::sin(theta) * direction.x(),
          std::sin(theta) * direction.y(),
          std::cos(theta)};
}

bool ProjectRay(const Coefficients& k,
                const Eigen::Vector3d& ray_C,
                Eigen::Vector2d* d) {
  return CameraEquidistant(k).Project<double>(
      kEquidistantPlane, ray_C, d, nullptr);
}

TEST(CameraEquidistant, IsTheFormulaAtAnyAngle) {
  RandomValues random(1);
  for (int i = 0; i < kEquidistantTrials; ++i) {
    const Coefficients k = {random.Uniform(0, 0.1),
                            random.Uniform(0, 0.1),
                            random.Uniform(0, 0.1),
                            random.Uniform(0, 0.1)};
    const double theta = random.Uniform(0.01, 3.14);
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    double theta_d = theta;
    for (int j = 0; j < 4; ++j) theta_d += k[j] * std::pow(theta, 2 * j + 3);
    Eigen::Vector2d d;
    ASSERT_TRUE(ProjectRay(k, AtAngle(theta, direction), &d));
    // Directions near the backward axis depend on the rounding of the ray.
    EXPECT_LT((d - theta_d * direction).norm(),
              1e-15 * theta_d * (10 + 2 / std::sin(theta)));
  }
}

TEST(CameraEquidistant, RegionEndsWhereTheProfileStopsRising) {
  RandomValues random(2);
  for (int i = 0; i < kEquidistantTrials; ++i) {
    // 1 + 3 k1 theta^2 has its zero at `border`.
    const double border = random.Uniform(0.2, 3.1);
    const Coefficients k = {-1 / (3 * border * border), 0, 0, 0};
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    Eigen::Vector2d d;
    EXPECT_TRUE(ProjectRay(k, AtAngle(border - 1e-9, direction), &d));
    EXPECT_FALSE(ProjectRay(k, AtAngle(border + 1e-9, direction), &d));
    // The profile ends at 2/3 of the angle.
    Eigen::Vector3d ray;
    EXPECT_TRUE(CameraEquidistant(k).Unproject(
        (2 * border / 3 - 1e-6) * direction, &ray));
    EXPECT_FALSE(CameraEquidistant(k).Unproject(
        (2 * border / 3 + 1e-6) * direction, &ray));
  }
}

TEST(CameraEquidistant, RegionEndsJustBeforeTheBackwardAxis) {
  RandomValues random(4);
  const double border = 2 * std::atan(2000);
  EXPECT_NEAR(border, std::numbers::pi, 1.01e-3);
  for (int i = 0; i < kEquidistantTrials; ++i) {
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    const double gap = std::abs(random.SignedMagnitude(1e-11, 1e-3));
    Eigen::Vector2d d;
    Eigen::Vector3d ray;
    const Coefficients k = {0, 0, 0, 0};
    EXPECT_TRUE(ProjectRay(k, AtAngle(border - gap, direction), &d));
    EXPECT_FALSE(ProjectRay(k, AtAngle(border + gap, direction), &d));
    EXPECT_TRUE(
        CameraEquidistant(k).Unproject((border - gap) * direction, &ray));
    EXPECT_FALSE(
        CameraEquidistant(k).Unproject((border + gap) * direction, &ray));
  }
}

TEST(CameraEquidistant, UnprojectFindsTheAngleOfEveryRisingProfile) {
  RandomValues random(3);
  int checked = 0;
  int beyond = 0;
  for (int i = 0; i < 2 * kEquidistantTrials; ++i) {
    Coefficients k;  // far rougher than any lens
    const double theta = std::abs(random.SignedMagnitude(1e-12, 3.1));
    const double rough = theta < 1.5 ? 0.6 : 0.02;
    for (double& value : k) value = random.Uniform(-rough, rough);
    const double Q = theta * theta;
    const double slope =
        1 + Q * (3 * k[0] + Q * (5 * k[1] + Q * (7 * k[2] + Q * 9 * k[3])));
    const Eigen::Vector3d ray =
        AtAngle(theta, random.Vector(2, 1).normalized());
    Eigen::Vector2d d;
    if (!ProjectRay(k, ray, &d)) continue;
    if (slope < 0.01) continue;  // ill-conditioned
    Eigen::Vector3d again;
    ASSERT_TRUE(CameraEquidistant(k).Unproject(d, &again));
    const double angle = std::atan2(again.head<2>().norm(), again.z());
    EXPECT_NEAR(angle, theta, 3e-15 * theta / slope * (1 + slope));
    EXPECT_LT(
        (again.head<2>().normalized() - ray.head<2>().normalized()).norm(),
        1e-14);
    ++checked;
    if (theta > std::numbers::pi / 2) ++beyond;
  }
  EXPECT_GT(checked, kEquidistantTrials);
  EXPECT_GT(beyond, 50);
}

TEST(CameraEquidistant, TheAxisIsItsOwnImage) {
  const Coefficients k = {0.1, -0.05, 0.02, 0.01};
  const CameraEquidistant model(k);
  Eigen::Vector2d d;
  ProjectionParts<double, 4> parts;
  ASSERT_TRUE(model.Project<double>(
      kEquidistantPlane, Eigen::Vector3d(0, 0, 2), &d, &parts));
  EXPECT_EQ(d, Eigen::Vector2d::Zero());
  EXPECT_EQ(parts.point.leftCols<2>(), Eigen::Matrix2d::Identity() / 2);
  EXPECT_TRUE(parts.point.col(2).isZero(0));
  EXPECT_TRUE(parts.distortion.isZero(0));
  Eigen::Vector3d ray;
  ASSERT_TRUE(model.Unproject(Eigen::Vector2d::Zero(), &ray));
  EXPECT_EQ(ray, Eigen::Vector3d::UnitZ());
}

}  // namespace
}  // namespace selfcal
