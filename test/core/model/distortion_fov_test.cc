#include "core/model/distortion_fov.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "test/core/model/random_values.h"
#include "test/core/numeric_jacobian.h"

namespace selfcal {
namespace {

constexpr int kFovTrials = 5000;
using Real = long double;

// The formula as the paper writes it, in more digits: precise for every w and r
// but exactly zero.
Real DistortedRadius(Real w, Real r) {
  return std::atan(2 * r * std::tan(w / 2)) / w;
}

// d radius / d w by differences of fourth order of the above.
Real DistortedRadiusByW(Real w, Real r) {
  const Real step =
      1e-3L * std::min<Real>(1, std::numbers::pi - std::abs(w)) / (1 + r);
  const auto difference = [&](int n) {
    return DistortedRadius(w + n * step, r) - DistortedRadius(w - n * step, r);
  };
  return (8 * difference(1) - difference(2)) / (12 * step);
}

struct Result {
  Eigen::Vector2d d;
  Eigen::Matrix2d by_u;
  Eigen::Matrix<double, 2, 1> by_w;
};

Result Distort(double w, const Eigen::Vector2d& u) {
  Result result;
  const std::array<double, 1> k = {w};
  EXPECT_TRUE(DistortionFov(k).Distort<double>(
      u, &result.d, &result.by_u, &result.by_w));
  return result;
}

TEST(DistortionFov, ValueIsExactForEveryOpeningAngleAndRadius) {
  RandomValues random(1);
  for (int i = 0; i < kFovTrials; ++i) {
    const double w = i % 2 == 0 ? random.SignedMagnitude(1e-15, 3.14)
                                : random.Uniform(0.5, 3.14);
    const double r = std::abs(random.SignedMagnitude(1e-15, 1e6));
    const double expected = static_cast<double>(DistortedRadius(w, r));
    EXPECT_NEAR(Distort(w, {r, 0}).d.x() / expected, 1, 2e-15) << w << " " << r;
  }
}

TEST(DistortionFov, DerivativeByOpeningAngleHoldsDownToZero) {
  RandomValues random(2);
  for (int i = 0; i < kFovTrials; ++i) {
    const double w = i % 2 == 0 ? random.SignedMagnitude(1e-12, 3.1)
                                : random.Uniform(0.5, 3.1);
    const double r = std::abs(random.SignedMagnitude(1e-9, 10));
    const double expected = static_cast<double>(DistortedRadiusByW(w, r));
    // The second term is the rounding of the reference, 1e-18 r over its step;
    // the test of the expansion holds where it would hide something.
    EXPECT_NEAR(Distort(w, {0, r}).by_w.y(),
                expected,
                1e-10 * std::abs(expected) + 1e-15 * r * (1 + r))
        << w << " " << r;
  }
}

// d(w) = u (1 + w^2 (1/12 - r^2/3) + ...) to fourth order in w.
TEST(DistortionFov, BehavesAsItsExpansionAboutNoDistortion) {
  RandomValues random(3);
  for (int i = 0; i < kFovTrials; ++i) {
    const double w = random.SignedMagnitude(1e-9, 1e-4);
    const Eigen::Vector2d u = random.Vector(2, 1);
    const double bend = 1.0 / 12 - u.squaredNorm() / 3;
    const Result result = Distort(w, u);
    EXPECT_LT((result.d - u * (1 + w * w * bend)).norm(), 1e-15);
    EXPECT_LT((result.by_w - 2 * w * bend * u).norm(), 1e-7 * std::abs(w));
  }
  const Eigen::Vector2d u(0.3, -0.7);
  const Result none = Distort(0, u);
  EXPECT_EQ(none.d, u);
  EXPECT_EQ(none.by_u, Eigen::Matrix2d::Identity());
  EXPECT_EQ(none.by_w, Eigen::Vector2d::Zero());
}

TEST(DistortionFov, IsEvenInTheOpeningAngle) {
  RandomValues random(4);
  for (int i = 0; i < kFovTrials; ++i) {
    const double w = random.SignedMagnitude(1e-9, 3.1);
    const Eigen::Vector2d u = random.Vector(2, 3);
    const Result plus = Distort(w, u);
    const Result minus = Distort(-w, u);
    EXPECT_EQ(plus.d, minus.d);
    EXPECT_EQ(plus.by_u, minus.by_u);
    EXPECT_EQ(plus.by_w, -minus.by_w);
  }
}

TEST(DistortionFov, IsContinuousAcrossTheSwitchesToTheSeries) {
  RandomValues random(5);
  const auto expect_continuous = [](const Result& a, const Result& b) {
    EXPECT_LT((a.d - b.d).norm(), 1e-11 * a.d.norm());
    EXPECT_LT((a.by_u - b.by_u).norm(), 1e-11 * a.by_u.norm());
    EXPECT_LT((a.by_w - b.by_w).norm(), 1e-10 * a.by_w.norm());
  };
  for (int i = 0; i < kFovTrials; ++i) {
    // tan(w/2)/(w/2) switches at w = 0.1.
    const Eigen::Vector2d u = random.Vector(2, 2);
    expect_continuous(Distort(0.1 * (1 - 1e-14), u),
                      Distort(0.1 * (1 + 1e-14), u));
    // atan(sqrt(q))/sqrt(q) switches where 2 tan(w/2) r = 0.1.
    const double w = random.Uniform(0.2, 3);
    const Eigen::Vector2d at = 0.05 / std::tan(w / 2) * u.normalized();
    expect_continuous(Distort(w, (1 - 1e-14) * at),
                      Distort(w, (1 + 1e-14) * at));
  }
}

TEST(DistortionFov, UndistortInvertsDistortForEveryOpeningAngle) {
  RandomValues random(6);
  for (int i = 0; i < kFovTrials; ++i) {
    const double w = random.SignedMagnitude(1e-15, 3.1);
    const double r = std::abs(random.SignedMagnitude(1e-15, 3));
    const Eigen::Vector2d u = r * random.Vector(2, 1).normalized();
    Eigen::Vector2d again;
    ASSERT_TRUE(DistortionFov(w).Undistort(Distort(w, u).d, &again));
    // The slope of tan at r_d w magnifies rounding.
    const double t = 2 * r * std::tan(w / 2);
    EXPECT_LT((again - u).norm(), 3e-15 * r * (1 + t * t)) << w << " " << r;
  }
}

TEST(DistortionFov, UndistortRefusesRadiiThatNoPointHas) {
  Eigen::Vector2d u;
  RandomValues random(7);
  for (int i = 0; i < kFovTrials; ++i) {
    const double w = random.SignedMagnitude(1e-3, 3.1);
    const std::array<double, 1> k = {w};
    const double limit = std::numbers::pi / 2 / std::abs(w);
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    EXPECT_TRUE(
        DistortionFov(k).Undistort(limit * (1 - 1e-12) * direction, &u));
    EXPECT_FALSE(
        DistortionFov(k).Undistort(limit * (1 + 1e-12) * direction, &u));
  }
}

TEST(DistortionFov, RefusesOpeningAnglesOfPiAndMore) {
  const Eigen::Vector2d u(0.1, 0.2);
  Eigen::Vector2d d;
  for (const double w : {std::numbers::pi, -std::numbers::pi, 4.0, 1e300}) {
    const std::array<double, 1> k = {w};
    EXPECT_FALSE(DistortionFov(k).Distort<double>(u, &d, nullptr, nullptr))
        << w;
    EXPECT_FALSE(DistortionFov(k).Undistort(u, &d)) << w;
  }
}

}  // namespace
}  // namespace selfcal
