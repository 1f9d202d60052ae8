// Compares the propagated covariance with the scatter of integrals of noisy
// readings.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "core/factor/preintegration.h"
#include "core/model/so3.h"
#include "test/core/factor/analytic_motion.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;
using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

constexpr int kTrials = 4000;

struct Experiment {
  AnalyticMotion motion;
  ImuCalibration imu;
  ImuNoise noise;
  std::int64_t t1_ns;

  ImuSample Reading(std::int64_t t_ns) const {
    return motion.Reading(t_ns, imu, Vector3d::Zero(), Vector3d::Zero(), 9.81);
  }
  Preintegration Integrate(std::span<const ImuSample> samples,
                           bool covariance) const {
    return Preintegrate(samples,
                        0,
                        t1_ns,
                        imu,
                        Vector3d::Zero(),
                        Vector3d::Zero(),
                        noise,
                        {.jacobians = false, .covariance = covariance});
  }
};

Experiment RandomExperiment(RandomValues& random, std::int64_t t1_ns) {
  Experiment experiment{.motion = AnalyticMotion(random),
                        .imu = random.Imu(),
                        .noise = {},
                        .t1_ns = t1_ns};
  // Intrinsics that the noise cannot pass through unchanged.
  experiment.imu.s_g += random.Normal3(0.3);
  experiment.imu.s_a += random.Normal3(0.3);
  experiment.noise.gyro_noise_density = random.LogUniform(1e-4, 1e-3);
  experiment.noise.accel_noise_density = random.LogUniform(1e-3, 1e-2);
  experiment.noise.gyro_bias_random_walk = 0;
  experiment.noise.accel_bias_random_walk = 0;
  return experiment;
}

// Noise of a sensor with one sample every period_ns.
void AddNoise(RandomValues& random,
              const ImuNoise& noise,
              std::int64_t period_ns,
              ImuSample* sample) {
  const double root = std::sqrt(1e-9 * static_cast<double>(period_ns));
  sample->gyro += random.Normal3(noise.gyro_noise_density / root);
  sample->accel += random.Normal3(noise.accel_noise_density / root);
}

// Second moments of the errors of all trials, whitened by the covariance: the
// identity, within the sampling error.
template <class MakeNoisy>
Matrix9d WhitenedMoments(const Experiment& experiment,
                         std::span<const ImuSample> clean,
                         const MakeNoisy& noisy) {
  const Preintegration expected = experiment.Integrate(clean, true);
  const Eigen::LLT<Matrix9d> llt(expected.covariance);
  Matrix9d moments = Matrix9d::Zero();
  for (int trial = 0; trial < kTrials; ++trial) {
    const Preintegration measured = experiment.Integrate(noisy(), false);
    Vector9d error;
    error << Log(expected.Delta_R.conjugate() * measured.Delta_R),
        measured.Delta_v - expected.Delta_v,
        measured.Delta_p - expected.Delta_p;
    const Vector9d white = llt.matrixL().solve(error);
    moments += white * white.transpose();
  }
  return moments / kTrials;
}

// A mean of kTrials products of unit normal variables scatters by
// 1 / sqrt(kTrials), or sqrt(2) times that on the diagonal. Of the 45 entries
// the worst lies within four such sigmas with probability 0.997; `model` is how
// far the sampled noise may differ from white noise in continuous time.
void ExpectIdentity(const Matrix9d& moments, double model) {
  const double sigma = 1 / std::sqrt(kTrials);
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < i; ++j) {
      EXPECT_NEAR(moments(i, j), 0, 4 * sigma + model) << i << ", " << j;
    }
    EXPECT_NEAR(moments(i, i), 1, 4 * std::sqrt(2) * sigma + model) << i;
  }
  // Their sum is the chi-square of all trials together.
  EXPECT_NEAR(moments.trace(), 9, 4 * std::sqrt(18) * sigma + 9 * model);
}

TEST(PreintegrationNoise, CovarianceIsTheScatterUnderNoiseOnEachSample) {
  RandomValues random(1);
  // Half of the first and of the last sample lies outside of the interval,
  // which is one part in 400 here.
  const std::int64_t period_ns = 1'000'000;
  const Experiment experiment = RandomExperiment(random, 400 * period_ns);
  std::vector<ImuSample> clean;
  for (int i = 0; i <= 400; ++i) {
    clean.push_back(experiment.Reading(i * period_ns));
  }
  const Matrix9d moments = WhitenedMoments(experiment, clean, [&] {
    std::vector<ImuSample> samples = clean;
    for (ImuSample& sample : samples) {
      AddNoise(random, experiment.noise, period_ns, &sample);
    }
    return samples;
  });
  ExpectIdentity(moments, 0.01);
}

// If samples are lost the noise of the neighbouring ones has more weight: noise
// belongs to samples, not to the time between two.
TEST(PreintegrationNoise, CovarianceIsTheScatterWhereSamplesAreLost) {
  RandomValues random(2);
  const std::int64_t period_ns = 1'000'000;
  const Experiment experiment = RandomExperiment(random, 400 * period_ns);
  for (const double lost : {0.05, 0.3}) {
    std::vector<ImuSample> clean;
    for (int i = 0; i <= 400; ++i) {
      if (i > 0 && i < 400 && random.Uniform(0, 1) < lost) continue;
      clean.push_back(experiment.Reading(i * period_ns));
    }
    const Matrix9d moments = WhitenedMoments(experiment, clean, [&] {
      std::vector<ImuSample> samples = clean;
      for (ImuSample& sample : samples) {
        AddNoise(random, experiment.noise, period_ns, &sample);
      }
      return samples;
    });
    ExpectIdentity(moments, 0.03);
  }
}

TEST(PreintegrationNoise, DoesNotDependOnTheRateOfTheSamples) {
  RandomValues random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const Experiment experiment = RandomExperiment(random, 200'000'000);
    const auto covariance = [&](std::int64_t period_ns) -> Matrix9d {
      std::vector<ImuSample> samples;
      for (std::int64_t t = 0; t <= experiment.t1_ns; t += period_ns) {
        samples.push_back(experiment.Reading(t));
      }
      return experiment.Integrate(samples, true).covariance;
    };
    // Whitened by the one covariance, the other is the identity.
    const Eigen::LLT<Matrix9d> llt(covariance(1'000'000));
    const Matrix9d half = llt.matrixL().solve(covariance(10'000'000));
    const Matrix9d white = llt.matrixL().solve(half.transpose());
    EXPECT_LT((white - Matrix9d::Identity()).norm(), 0.01);
  }
}

}  // namespace
}  // namespace selfcal
