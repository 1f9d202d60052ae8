// Correlated pixel errors along a track are detected, and sigmas remain
// consistent.
#include "core/calibration/track_noise.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include "core/calibration/calibrate.h"
#include "core/calibration/subspace.h"
#include "core/calibration/theta_information.h"
#include "core/simulation/simulate.h"
#include "test/core/calibration/screened_session.h"

namespace selfcal {
namespace {

struct Outcome {
  CalibrationResult result;
  double nees = 0;
};

// A simulated device that moves so, and whose rig states `believed` times the
// actual pixel noise.
Outcome CalibrateDevice(const Trajectory& motion,
                        std::uint64_t seed,
                        double pixel_correlation,
                        double believed,
                        const CalibrateOptions& options) {
  Rig rig = HandheldRig("simulated");
  const Calibration truth = rig.factory;
  rig.factory = PerturbCalibration(truth, {}, seed);
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.pixel_correlation = pixel_correlation;
  const auto session =
      Simulate(rig, truth, rig.factory, motion, "session", simulation);
  rig.pixel_sigma_px *= believed;
  Outcome outcome{Calibrate(rig, rig.factory, session.segments, options), 0};
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd error = BoxMinus(outcome.result.theta, truth)(free);
  const Eigen::MatrixXd covariance = outcome.result.covariance(free, free);
  outcome.nees = error.dot(covariance.ldlt().solve(error));
  return outcome;
}

Outcome CalibrateDevice(std::uint64_t seed,
                        double pixel_correlation,
                        double believed,
                        const CalibrateOptions& options) {
  return CalibrateDevice(
      *MakeMixed(17, seed), seed, pixel_correlation, believed, options);
}

TEST(TrackNoise, IndependentErrorsAreNotScaled) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const CalibrationResult result = CalibrateDevice(seed, 0, 1, {}).result;
    ASSERT_EQ(result.status, CalibrateStatus::kConverged);
    EXPECT_EQ(result.track_noise_factor, 1) << "seed " << seed;
  }
}

// Ratio of the sigmas of two results, geometric mean.
double SigmaRatio(const CalibrationResult& a, const CalibrationResult& b) {
  const std::vector<int> free = FreeComponents(HandheldRig("simulated"));
  const Eigen::ArrayXd ratios = a.covariance.diagonal()(free).array() /
                                b.covariance.diagonal()(free).array();
  return std::exp(0.5 * ratios.log().mean());
}

TEST(TrackNoise, SigmasAreConsistentWhenThePixelSigmaIsTooSmall) {
  for (const LossKind loss :
       {LossKind::kNone, LossKind::kHuber, LossKind::kCauchy}) {
    CalibrateOptions options;
    options.loss = loss;
    // The noise scales would account for it as well.
    options.reweight_noise = false;
    const CalibrationResult right = CalibrateDevice(4, 0, 1, options).result;
    const CalibrationResult small = CalibrateDevice(4, 0, 0.5, options).result;
    ASSERT_EQ(small.status, CalibrateStatus::kConverged);
    EXPECT_GT(small.track_noise_factor, 1.2);
    // A loss at half the scale reduces the information by a few percent. If
    // weights decrease as fast as Cauchy's, the weights of residuals, which
    // landmarks have reduced, claim more than those of the errors would.
    const double ratio = SigmaRatio(small, right);
    EXPECT_GT(ratio, loss == LossKind::kCauchy ? 0.85 : 0.95)
        << "loss " << static_cast<int>(loss);
    EXPECT_LT(ratio, 1.2) << "loss " << static_cast<int>(loss);
    if (loss == LossKind::kNone) {
      EXPECT_NEAR(small.track_noise_factor, 2, 0.1);
    }
  }
}

TEST(TrackNoise, SigmasAreConsistentWhenTracksDrift) {
  constexpr int kSeeds = 6;
  double with = 0, without = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Outcome weighted = CalibrateDevice(seed, 0.8, 1, {});
    ASSERT_EQ(weighted.result.status, CalibrateStatus::kConverged);
    with += weighted.nees;
    without += CalibrateDevice(seed, 0.8, 1, {.correlated_tracks = false}).nees;
  }
  // 99.9 % of the chi-square distribution with 6 x 26 degrees of freedom.
  EXPECT_LT(with, 215.7);
  EXPECT_GT(without, 215.7);
  std::printf("mean NEES of 26: %.1f, unweighted %.1f\n",
              with / kSeeds,
              without / kSeeds);
}

// Calm motion leaves directions that are released later, after which the noise
// is estimated once more, at weights that account for the track noise already.
// If that were forgotten, the errors of the tracks would pass for random walks
// of the biases, up to five times too large.
TEST(TrackNoise, ErrorsOfTracksDoNotPassForWalks) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const CalibrationResult result =
        CalibrateDevice(*MakeHandheld(8.5, 0.15, seed), seed, 0.9, 1, {})
            .result;
    ASSERT_EQ(result.status, CalibrateStatus::kConverged);
    EXPECT_GT(result.track_noise_factor, 1.5);
    for (const NoiseKind kind :
         {NoiseKind::kGyroBiasWalk, NoiseKind::kAccelBiasWalk}) {
      EXPECT_LT(result.noise_scales.at(IndexOf(kind)).used, 2)
          << NoiseKindName(kind) << ", seed " << seed;
    }
  }
}

// The ratio of a session with these errors, at its truth.
double SuccessiveRatio(const SimulationOptions& options) {
  const ScreenedSession session(
      HandheldRig("r"), *MakeHandheld(8.5, 1, options.seed), options);
  const auto whitening = WhitenInertialLinks(session.rig,
                                             session.rig.factory,
                                             session.problem,
                                             session.problem.keyframes);
  const Eigen::MatrixXd basis =
      TangentBasis(session.rig, WholeSubspace(session.rig));
  return SuccessiveNoiseRatio(
      {.rig = session.rig,
       .reference = session.rig.factory,
       .problem = session.problem,
       .motions = session.motions,
       .whitening = whitening,
       .basis = basis,
       .loss = session.screening.loss},
      {Eigen::VectorXd::Zero(TangentSize(session.rig.factory)),
       session.problem.keyframes},
      session.screening.landmarks);
}

// The variance of a second difference of errors with the correlation a from one
// to the next is 6 - 8 a + 2 a^2 of theirs, of which landmarks absorb a part.
TEST(SuccessiveNoise, IsThatOfSecondDifferences) {
  SimulationOptions options;
  options.seed = 5;
  options.mean_track_length = 40;
  options.revisit_fraction = 0;
  EXPECT_GT(SuccessiveRatio(options), 0.97);
  for (const double a : {0.4, 0.8}) {
    options.pixel_correlation = a;
    const double expected = std::sqrt((6 - 8 * a + 2 * a * a) / 6);
    const double ratio = SuccessiveRatio(options);
    EXPECT_GT(ratio, 0.97 * expected);
    EXPECT_LT(ratio, 1.5 * expected);
    std::printf("ratio %.3f, of errors alone %.3f\n", ratio, expected);
  }
}

}  // namespace
}  // namespace selfcal
