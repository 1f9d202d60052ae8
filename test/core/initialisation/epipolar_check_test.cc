#include "core/initialisation/epipolar_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/model/so3.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr double kPxPerRad = 400;

// Points seen from two views, with noise; the first `wrong` of them moved
// meanwhile, all in one direction as an object does, or every other one in the
// opposite one as mismatches are.
struct Views {
  Eigen::Quaterniond q_BA;
  Eigen::Vector3d t_B;  // [m]
  std::vector<RayPair> pairs;
};

Views MakeViews(unsigned seed,
                int points,
                int wrong,
                double moved_m,
                double noise_px,
                double translation_m = 0.1,
                bool together = true) {
  RandomValues random(seed);
  Views views;
  views.q_BA = Exp(0.1 * random.Direction());
  views.t_B = translation_m * random.Direction();
  if (!together) views.t_B.z() = 0;  // as two cameras beside each other
  const auto noisy = [&](const Eigen::Vector3d& p) {
    return (p.normalized() + random.Uniform(-1.7, 1.7) * noise_px / kPxPerRad *
                                 random.Direction().cross(p.normalized()))
        .normalized();
  };
  for (int i = 0; i < points; ++i) {
    const Eigen::Vector3d p_A(
        random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(1.5, 4));
    Eigen::Vector3d p_B = views.q_BA * p_A + views.t_B;
    if (i < wrong) {
      // Across the epipolar plane, as a motion within it cannot be seen.
      const double sign = together || i % 2 == 0 ? 1 : -1;
      p_B += sign * moved_m * p_B.cross(views.t_B).normalized();
    }
    views.pairs.push_back({noisy(p_A), noisy(p_B)});
  }
  return views;
}

EpipolarOptions Options() {
  EpipolarOptions options;
  options.px_per_rad = kPxPerRad;
  return options;
}

TEST(EpipolarCheck, FindsTheDirectionAndRejectsWhatMoves) {
  for (unsigned seed = 1; seed <= 50; ++seed) {
    // 4 cm at up to 5 m are 3 px and more.
    const Views views = MakeViews(seed, 150, 45, 0.04, 0.1);
    const EpipolarFit fit = CheckEpipolar(views.pairs, views.q_BA, Options());
    EXPECT_GT(fit.t_B.dot(views.t_B.normalized()), 0.99) << seed;
    EXPECT_LE(std::count(fit.inliers.begin(), fit.inliers.begin() + 45, 1), 1)
        << seed;
    EXPECT_EQ(std::count(fit.inliers.begin() + 45, fit.inliers.end(), 1), 105)
        << seed;
  }
}

TEST(EpipolarCheck, CorrectsARotationThatIsWrong) {
  double error_rad = 0;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    RandomValues random(1000 + seed);
    const Views views = MakeViews(seed, 150, 30, 0.06, 0.1);
    // 2 px.
    const Eigen::Quaterniond given =
        Exp(0.005 * random.Direction()) * views.q_BA;
    const EpipolarFit fit = CheckEpipolar(views.pairs, given, Options());
    error_rad += Log(fit.q_BA.conjugate() * views.q_BA).norm() / 50;
    EXPECT_LE(std::count(fit.inliers.begin(), fit.inliers.begin() + 30, 1), 2)
        << seed;
    EXPECT_GE(std::count(fit.inliers.begin() + 30, fit.inliers.end(), 1), 118)
        << seed;
  }
  // Less than half of 0.005 is left: a small rotation looks much like a
  // translation.
  EXPECT_LT(error_rad, 0.002);
}

TEST(EpipolarCheck, KnownDirectionToleratesExtrinsicsThatAreWrongByDegrees) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    RandomValues random(2000 + seed);
    const Views views = MakeViews(seed, 120, 20, 0.1, 0.1, 0.1, false);
    const Eigen::Quaterniond given =
        Exp(0.04 * random.Direction()) * views.q_BA;
    const EpipolarFit fit =
        CheckEpipolar(views.pairs, given, Options(), views.t_B);
    EXPECT_LE(std::count(fit.inliers.begin(), fit.inliers.begin() + 20, 1), 2)
        << seed;
    EXPECT_GE(std::count(fit.inliers.begin() + 20, fit.inliers.end(), 1), 98)
        << seed;
  }
}

TEST(EpipolarCheck, KeepsAllPointsOfARotationInPlace) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const Views views = MakeViews(seed, 100, 0, 0, 0.15, 0);
    const EpipolarFit fit = CheckEpipolar(views.pairs, views.q_BA, Options());
    EXPECT_EQ(std::count(fit.inliers.begin(), fit.inliers.end(), 1), 100)
        << seed;
  }
}

TEST(EpipolarCheck, RejectsPointsThatWouldLieBehindTheCamera) {
  Views views = MakeViews(1, 100, 0, 0, 0.05);
  for (int i = 0; i < 10; ++i) {
    // The parallax of a point with the opposite translation.
    const Eigen::Vector3d p_A(0.2 * i - 1, 0.3, 2);
    views.pairs[i] = {p_A.normalized(),
                      (views.q_BA * p_A - views.t_B).normalized()};
  }
  const EpipolarFit fit = CheckEpipolar(views.pairs, views.q_BA, Options());
  EXPECT_EQ(std::count(fit.inliers.begin(), fit.inliers.begin() + 10, 1), 0);
  EXPECT_EQ(std::count(fit.inliers.begin() + 10, fit.inliers.end(), 1), 90);
}

TEST(EpipolarCheck, AcceptsTooFewPairsUnchecked) {
  const Views views = MakeViews(1, kMinEpipolarPairs - 1, 3, 1, 0);
  const EpipolarFit fit = CheckEpipolar(views.pairs, views.q_BA, Options());
  EXPECT_EQ(fit.inliers.size(), views.pairs.size());
  EXPECT_EQ(std::count(fit.inliers.begin(), fit.inliers.end(), 1),
            kMinEpipolarPairs - 1);
}

}  // namespace
}  // namespace selfcal
