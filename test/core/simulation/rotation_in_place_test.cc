#include <gtest/gtest.h>

#include <cmath>

#include "core/simulation/random.h"
#include "core/simulation/trajectory.h"
#include "test/core/simulation/derivatives.h"

namespace selfcal {
namespace {

constexpr double kDuration_s = 60;

std::unique_ptr<Trajectory> Rotation(double distance_m,
                                     double jitter_m,
                                     double excitation,
                                     std::uint64_t seed) {
  RotationInPlaceOptions options;
  options.pivot_I = distance_m * Eigen::Vector3d(2, -1, 2) / 3;
  options.pivot_jitter_m = jitter_m;
  options.excitation = excitation;
  return MakeRotationInPlace(kDuration_s, options, seed);
}

TEST(RotationInPlaceTest, DerivativesAreThoseOfThePose) {
  Random random(1, 0);
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    for (const double distance_m : {0.0, 0.05, 0.5}) {
      // Small angles take another branch of the rotation's derivatives.
      for (const double excitation : {1e-3, 1e-2, 1.0}) {
        const auto rotation = Rotation(distance_m, 3e-3, excitation, seed);
        for (int i = 0; i < 100; ++i) {
          ExpectDerivativesMatch(*rotation, random.Uniform(1, 59));
        }
      }
    }
  }
}

TEST(RotationInPlaceTest, ThePivotKeepsItsPlaceUpToItsJitter) {
  for (const double jitter_m : {0.0, 3e-3}) {
    const auto rotation = Rotation(0.5, jitter_m, 1, 3);
    const Eigen::Vector3d pivot_I = 0.5 * Eigen::Vector3d(2, -1, 2) / 3;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Vector3d square = Eigen::Vector3d::Zero();
    int count = 0;
    for (double t = 0; t < kDuration_s; t += 0.01, ++count) {
      const BodyMotion motion = rotation->At(t);
      const Eigen::Vector3d pivot_G = motion.p_GI + motion.q_GI * pivot_I;
      mean += pivot_G;
      square += pivot_G.cwiseAbs2();
    }
    mean /= count;
    square /= count;
    const Eigen::Vector3d deviation =
        (square - mean.cwiseAbs2()).cwiseMax(0).cwiseSqrt();
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(deviation[axis], jitter_m, 0.1 * jitter_m + 1e-7);
    }
  }
}

TEST(RotationInPlaceTest, RotatesVigorouslyAboutAllAxesAndMovesLittle) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const auto rotation = Rotation(0, 3e-3, 1, seed);
    Eigen::Vector3d square = Eigen::Vector3d::Zero();
    Eigen::Vector3d low = rotation->At(0).p_GI;
    Eigen::Vector3d high = low;
    int count = 0;
    for (double t = 0; t < kDuration_s; t += 0.02, ++count) {
      const BodyMotion motion = rotation->At(t);
      square += motion.w_I.cwiseAbs2();
      low = low.cwiseMin(motion.p_GI);
      high = high.cwiseMax(motion.p_GI);
    }
    EXPECT_GT((square / count).cwiseSqrt().minCoeff(), 0.4);
    EXPECT_LT((square / count).cwiseSqrt().maxCoeff(), 2);
    EXPECT_LT((high - low).maxCoeff(), 0.02);
  }
}

TEST(RotationInPlaceTest, TheSameSeedGivesTheSameBitsAndAnotherSeedDoesNot) {
  const auto a = Rotation(0.05, 3e-3, 1, 5);
  const auto b = Rotation(0.05, 3e-3, 1, 5);
  const auto c = Rotation(0.05, 3e-3, 1, 6);
  for (double t = 0; t < kDuration_s; t += 1.3) {
    EXPECT_EQ(a->At(t).p_GI, b->At(t).p_GI);
    EXPECT_EQ(a->At(t).q_GI.coeffs(), b->At(t).q_GI.coeffs());
    EXPECT_NE(a->At(t).p_GI, c->At(t).p_GI);
  }
}

}  // namespace
}  // namespace selfcal
