#include "core/simulation/trajectory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/simulation/random.h"
#include "test/core/simulation/derivatives.h"

namespace selfcal {
namespace {

// Root mean square over an interval of time.
double Rms(const Trajectory& trajectory,
           double begin_s,
           double end_s,
           const std::function<double(const BodyMotion&)>& norm) {
  double sum = 0;
  int count = 0;
  for (double t = begin_s; t < end_s; t += 0.02, ++count) {
    const double x = norm(trajectory.At(t));
    sum += x * x;
  }
  return std::sqrt(sum / count);
}

double Acceleration(const BodyMotion& motion) { return motion.a_GI.norm(); }
double Rate(const BodyMotion& motion) { return motion.w_I.norm(); }

TEST(TrajectoryTest, DerivativesAreThoseOfThePose) {
  Random random(1, 0);
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    for (const double excitation : {0.1, 1.0}) {
      const auto handheld = MakeHandheld(180, excitation, seed);
      for (int i = 0; i < 200; ++i) {
        ExpectDerivativesMatch(*handheld, random.Uniform(1, 179));
      }
    }
    const auto mixed = MakeMixed(180, seed);
    for (int i = 0; i < 200; ++i) {
      ExpectDerivativesMatch(*mixed, random.Uniform(1, 179));
    }
  }
}

TEST(TrajectoryTest, AccelerationAndRateOfMixedMotionAreContinuous) {
  const auto mixed = MakeMixed(120, 3);
  constexpr double kStep_s = 1e-4;
  BodyMotion last = mixed->At(0);
  for (double t = kStep_s; t < 119; t += kStep_s) {
    const BodyMotion now = mixed->At(t);
    // Two sines of 2 Hz and 2 m/s^2 have a jerk of 50 m/s^3 at most.
    ASSERT_LT((now.a_GI - last.a_GI).norm(), 100 * kStep_s) << "at " << t;
    ASSERT_LT((now.w_I - last.w_I).norm(), 50 * kStep_s) << "at " << t;
    last = now;
  }
}

TEST(TrajectoryTest, HandheldMotionIsVigorousInAllSixAxes) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto handheld = MakeHandheld(60, 1, seed);
    EXPECT_DOUBLE_EQ(handheld->duration_s(), 60);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GT(Rms(*handheld,
                    0,
                    60,
                    [&](const BodyMotion& m) { return m.a_GI[axis]; }),
                1);
      EXPECT_GT(Rms(*handheld,
                    0,
                    60,
                    [&](const BodyMotion& m) { return m.w_I[axis]; }),
                0.4);
    }
    EXPECT_LT(Rms(*handheld, 0, 60, Acceleration), 6);
    EXPECT_LT(Rms(*handheld, 0, 60, Rate), 3);
  }
}

TEST(TrajectoryTest, HandheldMotionStaysInTheRoom) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto handheld = MakeHandheld(180, 1, seed);
    for (double t = 0; t <= 180; t += 0.05) {
      const Eigen::Vector3d p_G = handheld->At(t).p_GI;
      ASSERT_LT(std::abs(p_G.x()), 4);
      ASSERT_LT(std::abs(p_G.y()), 3);
      ASSERT_GT(p_G.z(), 0);
      ASSERT_LT(p_G.z(), 4);
    }
  }
}

TEST(TrajectoryTest, ExcitationScalesTheMotion) {
  const auto calm = MakeHandheld(60, 0.1, 7);
  const auto vigorous = MakeHandheld(60, 1, 7);
  EXPECT_NEAR(
      Rms(*calm, 0, 60, Acceleration) / Rms(*vigorous, 0, 60, Acceleration),
      0.1,
      0.01);
}

TEST(TrajectoryTest, ABodyAtRestDoesNotMove) {
  const auto rest = MakeRest(20);
  const BodyMotion first = rest->At(0);
  for (double t = 0; t <= 20; t += 0.37) {
    const BodyMotion motion = rest->At(t);
    EXPECT_EQ(motion.p_GI, first.p_GI);
    EXPECT_EQ(motion.q_GI.coeffs(), first.q_GI.coeffs());
    EXPECT_EQ(motion.v_GI.norm(), 0);
    EXPECT_EQ(motion.a_GI.norm(), 0);
    EXPECT_EQ(motion.w_I.norm(), 0);
  }
}

TEST(TrajectoryTest, MixedMotionBeginsAtRestAndHasCalmAndExcitedStretches) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const auto mixed = MakeMixed(120, seed);
    EXPECT_EQ(Rms(*mixed, 0, 5, Acceleration), 0);
    int calm = 0;
    int excited = 0;
    for (double t = 8; t < 116; t += 4) {
      const double rms = Rms(*mixed, t, t + 4, Acceleration);
      calm += rms < 0.3;
      excited += rms > 2;
    }
    EXPECT_GE(calm, 5);
    EXPECT_GE(excited, 5);
  }
}

TEST(TrajectoryTest, TheSameSeedGivesTheSameBitsAndAnotherSeedDoesNot) {
  const auto a = MakeMixed(60, 5);
  const auto b = MakeMixed(60, 5);
  const auto c = MakeMixed(60, 6);
  for (double t = 0; t < 60; t += 1.3) {
    EXPECT_EQ(a->At(t).p_GI, b->At(t).p_GI);
    EXPECT_EQ(a->At(t).q_GI.coeffs(), b->At(t).q_GI.coeffs());
    EXPECT_NE(a->At(t).p_GI, c->At(t).p_GI);
  }
}

}  // namespace
}  // namespace selfcal
