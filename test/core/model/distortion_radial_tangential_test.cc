#include "core/model/distortion_radial_tangential.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr int kDistortionTrials = 3000;
using Coefficients = std::array<double, 4>;

bool IsValid(const Coefficients& k, const Eigen::Vector2d& u) {
  Eigen::Vector2d d;
  return DistortionRadialTangential(k).Distort<double>(u, &d, nullptr, nullptr);
}

TEST(DistortionRadialTangential, IsTheFormula) {
  const Coefficients k = {-0.28, 0.07, 2e-4, -3e-4};
  const double x = 0.4;
  const double y = -0.3;
  const double r2 = 0.25;
  const double radial = 1 - 0.28 * r2 + 0.07 * r2 * r2;
  Eigen::Vector2d d;
  ASSERT_TRUE(DistortionRadialTangential(k).Distort<double>(
      {x, y}, &d, nullptr, nullptr));
  EXPECT_NEAR(
      d.x(), x * radial + 2 * 2e-4 * x * y - 3e-4 * (r2 + 2 * x * x), 1e-16);
  EXPECT_NEAR(
      d.y(), y * radial - 2 * 3e-4 * x * y + 2e-4 * (r2 + 2 * y * y), 1e-16);
}

TEST(DistortionRadialTangential, RegionEndsWhereTheProfileStopsRising) {
  RandomValues random(1);
  for (int i = 0; i < kDistortionTrials; ++i) {
    const double k1 = random.Uniform(-1, -0.05);
    const double border = std::sqrt(-1 / (3 * k1));  // of 1 + 3 k1 r^2
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    const Coefficients k = {k1, 0, 0, 0};
    EXPECT_TRUE(IsValid(k, border * (1 - 1e-9) * direction));
    EXPECT_FALSE(IsValid(k, border * (1 + 1e-9) * direction));
    EXPECT_FALSE(IsValid(k, 100 * border * direction));
  }
}

TEST(DistortionRadialTangential, RegionDoesNotBeginAgainBeyondItsBorder) {
  // 1 + 3 k1 q + 5 k2 q^2 is negative between two zeros and positive after.
  const Coefficients k = {-0.4, 0.05, 0, 0};
  double border = 0;
  while (IsValid(k, {border, 0})) border += 1e-3;
  EXPECT_LT(border, 1.5);
  for (double r = border; r < 20; r += 1e-2) EXPECT_FALSE(IsValid(k, {r, 0}));
}

TEST(DistortionRadialTangential, RegionEndsWhereTangentialTermsFoldThePlane) {
  // On the x axis d_x = x + 3 p2 x^2 turns round at x = -1 / (6 p2), on the y
  // axis d_y at y = -1 / (6 p1); the radial profile rises everywhere.
  RandomValues random(4);
  for (int i = 0; i < kDistortionTrials; ++i) {
    const double p = random.Uniform(-0.2, -0.01);
    const double border = -1 / (6 * p);
    for (const double part : {0.1, 0.5, 0.999}) {
      EXPECT_TRUE(IsValid({0, 0, 0, p}, {part * border, 0}));
      EXPECT_TRUE(IsValid({0, 0, p, 0}, {0, part * border}));
    }
    for (const double part : {1.001, 2.0, 2.9, 3.1, 10.0}) {
      EXPECT_FALSE(IsValid({0, 0, 0, p}, {part * border, 0}));
      EXPECT_FALSE(IsValid({0, 0, p, 0}, {0, part * border}));
    }
  }
}

TEST(DistortionRadialTangential, NoTwoPointsOfTheRegionShareAnImage) {
  // What Undistort finds for the image of a point of the region is that point.
  RandomValues random(2);
  int checked = 0;
  for (int i = 0; i < kDistortionTrials; ++i) {
    Coefficients k;
    const DistortionVector random_k =
        random.Distortion(DistortionModel::kRadialTangential);
    for (int j = 0; j < 4; ++j) k[j] = random_k[j];
    const Eigen::Vector2d u = random.Vector(2, 2);
    Eigen::Vector2d d;
    Eigen::Matrix2d J;
    if (!DistortionRadialTangential(k).Distort<double>(u, &d, &J, nullptr))
      continue;
    if (J.determinant() < 1e-3) continue;  // ill-conditioned
    Eigen::Vector2d again;
    ASSERT_TRUE(DistortionRadialTangential(k).Undistort(d, &again));
    EXPECT_LT((again - u).norm(), 1e-11);
    ++checked;
  }
  EXPECT_GT(checked, kDistortionTrials / 3);
}

TEST(DistortionRadialTangential, UndistortFindsItsWayOverFlatParts) {
  RandomValues random(5);
  for (int i = 0; i < kDistortionTrials; ++i) {
    // The slope ((q / a - 1)^2 + c) / (1 + c) is small around r^2 = q = a: a
    // full Newton step from there goes far off.
    const double a = random.Uniform(0.1, 2);
    const double c = std::abs(random.SignedMagnitude(1e-3, 1));
    const Coefficients k = {
        -2 / (a * (1 + c)) / 3, 1 / (a * a * (1 + c)) / 5, 0, 0};
    const double r = random.Uniform(0, 3) * std::sqrt(a);
    const double q = r * r;
    const double slope = 1 + 3 * k[0] * q + 5 * k[1] * q * q;
    const Eigen::Vector2d u = r * random.Vector(2, 1).normalized();
    Eigen::Vector2d d;
    ASSERT_TRUE(
        DistortionRadialTangential(k).Distort<double>(u, &d, nullptr, nullptr));
    Eigen::Vector2d again;
    ASSERT_TRUE(DistortionRadialTangential(k).Undistort(d, &again));
    EXPECT_LT((again - u).norm(), 1e-14 * (1 + 1 / slope)) << r << " " << c;
  }
}

TEST(DistortionRadialTangential, UndistortRefusesRadiiBeyondTheLargest) {
  RandomValues random(3);
  for (int i = 0; i < kDistortionTrials; ++i) {
    const double k1 = random.Uniform(-1, -0.05);
    // r (1 + k1 r^2) at its maximum is 2/3 of the radius there.
    const double largest = 2.0 / 3 * std::sqrt(-1 / (3 * k1));
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    const Coefficients k = {k1, 0, 0, 0};
    Eigen::Vector2d u;
    EXPECT_TRUE(DistortionRadialTangential(k).Undistort(
        largest * (1 - 1e-6) * direction, &u));
    EXPECT_FALSE(DistortionRadialTangential(k).Undistort(
        largest * (1 + 1e-6) * direction, &u));
    EXPECT_FALSE(
        DistortionRadialTangential(k).Undistort(largest * 10 * direction, &u));
  }
}

}  // namespace
}  // namespace selfcal
