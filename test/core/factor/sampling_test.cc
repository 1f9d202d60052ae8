#include "core/factor/sampling.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/factor/inertial.h"
#include "test/core/factor/analytic_motion.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;

constexpr std::int64_t kSamplePeriod_ns = 5'000'000;

std::vector<ImuSample> SamplesAt(const std::vector<std::int64_t>& times_ms) {
  std::vector<ImuSample> samples;
  for (const std::int64_t t : times_ms) samples.push_back({t * 1'000'000});
  return samples;
}

TEST(Sampling, RegularStepsHaveTheDensitiesOfTheRig) {
  const std::vector<ImuSample> samples = SamplesAt({0, 5, 10, 15, 20, 25});
  const ImuNoise noise;
  const Sampling sampling(samples, 7'000'000, 18'000'000, noise);
  for (std::size_t next = 0; next <= samples.size(); ++next) {
    EXPECT_EQ(sampling.At(next).gyro, noise.gyro_noise_density);
    EXPECT_EQ(sampling.At(next).accel, noise.accel_noise_density);
  }
}

// One lost sample: each of the two neighbours represents one and a half steps.
// In squares of a sample's noise, over the three steps there are
//   1/4 + (3/2)^2 + (3/2)^2 + 1/4 of the outer halves, and the step
// densities give their sum.
TEST(Sampling, NoiseComesWithEachSample) {
  const std::vector<ImuSample> samples =
      SamplesAt({0, 5, 10, 15, 20, 30, 35, 40, 45, 50});
  const ImuNoise noise;
  const Sampling sampling(samples, 0, 50'000'000, noise);
  const auto squares = [&](std::size_t next, double steps) {
    const double gyro = sampling.At(next).gyro / noise.gyro_noise_density;
    EXPECT_NEAR(
        sampling.At(next).accel / noise.accel_noise_density, gyro, 1e-12);
    return steps * gyro * gyro;
  };
  EXPECT_NEAR(squares(3, 1), 1, 1e-12);
  // Half of an outer sample of the three steps is that of the next step.
  EXPECT_NEAR(squares(4, 1) + squares(5, 2) + squares(6, 1),
              2 * 1.5 * 1.5 + 2 * 0.5,
              1e-12);
}

TEST(Sampling, GapsAreCountedAgainstTheUsualStep) {
  EXPECT_EQ(FindGaps({}).count, 0);
  EXPECT_EQ(FindGaps(SamplesAt({0})).count, 0);
  EXPECT_EQ(FindGaps(SamplesAt({0, 5, 10, 15})).count, 0);
  // Timestamp jitter is not a gap.
  EXPECT_EQ(FindGaps(SamplesAt({0, 5, 11, 14, 20, 25})).count, 0);
  const SampleGaps gaps =
      FindGaps(SamplesAt({0, 5, 10, 20, 25, 30, 130, 135, 140}));
  EXPECT_EQ(gaps.count, 2);
  EXPECT_DOUBLE_EQ(gaps.longest_s, 0.1);
}

// Motions without noise, one gap each: the error of the integral matches the
// covariance, and is not much smaller, whether keyframes fall into the gap or
// not.
TEST(Sampling, TheCovarianceCoversTheMotionInAGap) {
  RandomValues random(1);
  for (const int gap_ms : {20, 50, 100, 200}) {
    constexpr int kTrials = 400;
    constexpr std::int64_t kEnd_ns = 300'000'000;
    double sum = 0;
    std::vector<double> squares;
    for (int trial = 0; trial < kTrials; ++trial) {
      const AnalyticMotion motion(random);
      const ImuCalibration imu = random.Imu();
      const auto begin_ns =
          std::llround(random.Uniform(-0.5e6 * gap_ms, 300e6 - 0.5e6 * gap_ms));
      std::vector<ImuSample> samples;
      for (const ImuSample& sample : motion.Readings(-400'000'000,
                                                     700'000'000,
                                                     kSamplePeriod_ns,
                                                     imu,
                                                     Vector3d::Zero(),
                                                     Vector3d::Zero(),
                                                     9.81)) {
        if (sample.t_ns > begin_ns &&
            sample.t_ns < begin_ns + gap_ms * 1'000'000) {
          continue;
        }
        samples.push_back(sample);
      }
      KeyframeState x0 = motion.State(0), x1 = motion.State(kEnd_ns);
      InertialMatrix covariance;
      const InertialResidual r = EvaluateInertial(
          samples, x0, x1, imu, ImuNoise(), 9.81, nullptr, &covariance);
      const double square =
          (SquareRootInformation(covariance) * r).head<9>().squaredNorm() / 9;
      squares.push_back(square);
      sum += square;
    }
    std::sort(squares.begin(), squares.end());
    std::printf("%d ms: mean square %.3f, 99 %% %.2f, worst %.2f\n",
                gap_ms,
                sum / kTrials,
                squares[kTrials * 99 / 100],
                squares.back());
    // There is neither noise nor a walk of biases: one is the bound.
    EXPECT_LT(sum / kTrials, 1);
    EXPECT_GT(sum / kTrials, 0.02);
    EXPECT_LT(squares[kTrials * 99 / 100], 4);
  }
}

}  // namespace
}  // namespace selfcal
