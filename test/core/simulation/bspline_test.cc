#include "core/simulation/bspline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/simulation/random.h"

namespace selfcal {
namespace {

Eigen::RowVector2d Parabola(double t) {
  return {3 - 2 * t + 0.5 * t * t, 1 + t};
}

BSpline FitParabola(const std::vector<double>& times_s, double duration_s) {
  Eigen::MatrixXd values(static_cast<Eigen::Index>(times_s.size()), 2);
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    values.row(static_cast<Eigen::Index>(i)) = Parabola(times_s[i]);
  }
  return {times_s, values, duration_s, 0.1};
}

// Third differences of a parabola's control points vanish: neither the fit nor
// the smoothing costs anything, wherever the values lie.
TEST(BSplineTest, ReproducesAParabolaExactlyFromAnyTimes) {
  Random random(1, 0);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<double> times_s = {0};
    while (times_s.back() < 5) {
      times_s.push_back(times_s.back() + random.Uniform(0.01, 0.4));
    }
    const BSpline spline = FitParabola(times_s, times_s.back());
    for (int i = 0; i < 100; ++i) {
      const double t = random.Uniform(0, times_s.back());
      const BSpline::Sample sample = spline.At(t);
      EXPECT_LT((sample.x.transpose() - Parabola(t)).norm(), 1e-7);
      EXPECT_NEAR(sample.d1[0], -2 + t, 1e-6);
      EXPECT_NEAR(sample.d1[1], 1, 1e-6);
      EXPECT_NEAR(sample.d2[0], 1, 1e-4);
      EXPECT_NEAR(sample.d2[1], 0, 1e-4);
    }
  }
}

TEST(BSplineTest, BothEndsBelongToIt) {
  const BSpline spline = FitParabola({0, 0.3, 0.7, 1}, 1);
  EXPECT_LT((spline.At(0).x.transpose() - Parabola(0)).norm(), 1e-7);
  EXPECT_LT((spline.At(1).x.transpose() - Parabola(1)).norm(), 1e-7);
}

TEST(BSplineTest, DerivativesAreThoseOfTheValue) {
  Random random(2, 0);
  std::vector<double> times_s;
  Eigen::MatrixXd values(200, 1);
  for (int i = 0; i < 200; ++i) {
    times_s.push_back(0.02 * i);
    values(i, 0) = random.Normal();
  }
  const BSpline spline(times_s, values, times_s.back(), 0.1);
  constexpr double h = 1e-5;
  for (int i = 0; i < 500; ++i) {
    const double t = random.Uniform(h, times_s.back() - h);
    const double d1 = (spline.At(t + h).x[0] - spline.At(t - h).x[0]) / (2 * h);
    const double d2 =
        (spline.At(t + h).d1[0] - spline.At(t - h).d1[0]) / (2 * h);
    EXPECT_NEAR(spline.At(t).d1[0], d1, 1e-4);
    EXPECT_NEAR(spline.At(t).d2[0], d2, 1e-3);
  }
}

}  // namespace
}  // namespace selfcal
