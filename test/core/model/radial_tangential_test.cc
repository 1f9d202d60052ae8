#include "core/model/radial_tangential.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr int kRadialTangentialTrials = 3000;
using Polynomial = RadialTangential<RadialPolynomial<3>>;
using Rational = RadialTangential<RadialRational>;

template <class Model>
bool IsValid(const std::array<double, Model::kSize>& k,
             const Eigen::Vector2d& u) {
  Eigen::Vector2d d;
  return Model(k).template Distort<double>(u, &d, nullptr, nullptr);
}

TEST(RadialTangential, CoefficientsAreInTheOrderOfOpenCv) {
  const double x = 0.4;
  const double y = -0.3;
  const double r2 = 0.25;
  Eigen::Vector2d d;
  ASSERT_TRUE(Polynomial(std::array{-0.28, 0.07, 2e-4, -3e-4, 0.02})
                  .Distort<double>({x, y}, &d, nullptr, nullptr));
  const double polynomial =
      1 - 0.28 * r2 + 0.07 * r2 * r2 + 0.02 * r2 * r2 * r2;
  EXPECT_NEAR(d.x(),
              x * polynomial + 2 * 2e-4 * x * y - 3e-4 * (r2 + 2 * x * x),
              2e-16);
  EXPECT_NEAR(d.y(),
              y * polynomial - 2 * 3e-4 * x * y + 2e-4 * (r2 + 2 * y * y),
              2e-16);
  ASSERT_TRUE(
      Rational(std::array{-0.28, 0.07, 2e-4, -3e-4, 0.02, 0.3, -0.1, 0.05})
          .Distort<double>({x, y}, &d, nullptr, nullptr));
  const double rational =
      polynomial / (1 + 0.3 * r2 - 0.1 * r2 * r2 + 0.05 * r2 * r2 * r2);
  EXPECT_NEAR(
      d.x(), x * rational + 2 * 2e-4 * x * y - 3e-4 * (r2 + 2 * x * x), 2e-16);
}

TEST(RadialTangential, RegionOfACubicEndsWhereTheProfileStopsRising) {
  RandomValues random(1);
  for (int i = 0; i < kRadialTangentialTrials; ++i) {
    // The slope is 1 + 7 k3 r^6.
    const double border = random.Uniform(0.3, 2);
    const std::array k = {0.0, 0.0, 0.0, 0.0, -1 / (7 * std::pow(border, 6))};
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    EXPECT_TRUE(IsValid<Polynomial>(k, border * (1 - 1e-9) * direction));
    EXPECT_FALSE(IsValid<Polynomial>(k, border * (1 + 1e-9) * direction));
    EXPECT_FALSE(IsValid<Polynomial>(k, 100 * border * direction));
    // The largest radius is 6/7 of that.
    Eigen::Vector2d u;
    EXPECT_TRUE(
        Polynomial(k).Undistort(6 * border / 7 * (1 - 1e-6) * direction, &u));
    EXPECT_FALSE(
        Polynomial(k).Undistort(6 * border / 7 * (1 + 1e-6) * direction, &u));
  }
}

TEST(RadialTangential, RegionOfARationalEndsWhereTheProfileStopsRising) {
  RandomValues random(2);
  for (int i = 0; i < kRadialTangentialTrials; ++i) {
    // r / (1 + k4 r^2) has its maximum 1 / (2 border) at border = 1 / sqrt(k4).
    const double border = random.Uniform(0.3, 2);
    const std::array k = {
        0.0, 0.0, 0.0, 0.0, 0.0, 1 / (border * border), 0.0, 0.0};
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    EXPECT_TRUE(IsValid<Rational>(k, border * (1 - 1e-9) * direction));
    EXPECT_FALSE(IsValid<Rational>(k, border * (1 + 1e-9) * direction));
    EXPECT_FALSE(IsValid<Rational>(k, 100 * border * direction));
    Eigen::Vector2d u;
    EXPECT_TRUE(Rational(k).Undistort(border / 2 * (1 - 1e-6) * direction, &u));
    EXPECT_FALSE(
        Rational(k).Undistort(border / 2 * (1 + 1e-6) * direction, &u));
  }
}

TEST(RadialTangential, RegionOfARationalEndsAtThePole) {
  RandomValues random(3);
  for (int i = 0; i < kRadialTangentialTrials; ++i) {
    // r / (1 + k6 r^6) rises up to the pole, and again beyond it.
    const double border = random.Uniform(0.3, 2);
    const std::array k = {
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1 / std::pow(border, 6)};
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    EXPECT_TRUE(IsValid<Rational>(k, border * (1 - 1e-9) * direction));
    EXPECT_FALSE(IsValid<Rational>(k, border * (1 + 1e-9) * direction));
    EXPECT_FALSE(IsValid<Rational>(k, 100 * border * direction));
    // Every radius has a point before the pole.
    const Eigen::Vector2d d = random.Uniform(0, 20) * direction;
    Eigen::Vector2d u;
    ASSERT_TRUE(Rational(k).Undistort(d, &u));
    EXPECT_LT(u.norm(), border);
  }
}

TEST(RadialTangential, RationalWhoseTermsCancelIsAPinhole) {
  RandomValues random(4);
  for (int i = 0; i < kRadialTangentialTrials; ++i) {
    std::array<double, 8> k = {};
    for (int j = 0; j < 3; ++j) {
      // As large as calibrated ones, without a zero in the image.
      k[j == 2 ? 4 : j] = k[5 + j] = random.Uniform(0, 100);
    }
    const Eigen::Vector2d u = random.Vector(2, 1);
    Eigen::Vector2d d;
    ASSERT_TRUE(Rational(k).Distort<double>(u, &d, nullptr, nullptr));
    EXPECT_LT((d - u).norm(), 1e-15);
    Eigen::Vector2d again;
    ASSERT_TRUE(Rational(k).Undistort(u, &again));
    EXPECT_LT((again - u).norm(), 1e-13);
  }
}

TEST(RadialTangential, NoTwoPointsOfTheRegionShareAnImage) {
  // Undistort finds each point of the region from its image.
  RandomValues random(5);
  int checked = 0;
  for (int i = 0; i < 3 * kRadialTangentialTrials; ++i) {
    std::array<double, 8> k;
    for (double& value : k) value = random.Uniform(-0.5, 0.5);
    k[2] *= 0.02;
    k[3] *= 0.02;
    const Eigen::Vector2d u = random.Vector(2, 2);
    Eigen::Vector2d d;
    Eigen::Matrix2d J;
    if (!Rational(k).Distort<double>(u, &d, &J, nullptr)) continue;
    if (J.determinant() < 1e-3 || d.norm() > 100) continue;  // ill-conditioned
    Eigen::Vector2d again;
    ASSERT_TRUE(Rational(k).Undistort(d, &again))
        << u.transpose() << " with " << Eigen::Map<Eigen::VectorXd>(&k[0], 8);
    EXPECT_LT((again - u).norm(), 1e-11);
    ++checked;
  }
  EXPECT_GT(checked, kRadialTangentialTrials / 2);
}

}  // namespace
}  // namespace selfcal
