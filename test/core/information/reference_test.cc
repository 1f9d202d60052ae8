// Compares the structured score with two slow implementations.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "core/information/linearisation.h"
#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/second_imu.h"
#include "test/core/information/test_segments.h"
#include "test/reference/ceres_segment.h"
#include "test/reference/segment_jacobian.h"
#include "test/reference/sparse_qr.h"

namespace selfcal {
namespace {

constexpr double kAgreement = 1e-9;  // of an entropy, relative

struct Case {
  Rig rig;
  Calibration theta0;
  MotionSegment segment;
  int gauge = 0;
};

// Two cameras with time offsets: known, estimated at another value, and one of
// each, which begins where the pose does not move. Then with a rolling shutter
// of one of them, and of both.
std::vector<Case> TimeOffsetCases() {
  std::vector<Case> cases;
  for (std::uint64_t seed = 5; seed <= 9; ++seed) {
    Case c;
    c.rig = TwoCameraRig();
    c.rig.factory.cameras[0].time_offset_s = 0.02;
    c.rig.factory.cameras[1].time_offset_s = seed == 7 ? 0 : -0.013;
    if (seed > 5) {
      c.rig.blocks = {{"*.time_offset", true}};
    }
    if (seed == 7) c.rig.fixed = {"cam0.time_offset"};
    if (seed > 7) c.rig.factory.cameras[1].line_delay_s = 6e-5;
    if (seed > 8) c.rig.factory.cameras[0].line_delay_s = -2e-5;
    if (seed > 7) c.rig.factory.cameras[0].time_drift = 3e-5;
    c.rig.groups = DefaultGroups(c.rig.blocks, c.rig.factory);
    c.theta0 = PerturbCalibration(c.rig.factory, {}, seed);
    if (seed == 6) c.theta0.cameras[1].time_offset_s -= 0.002;
    SimulationOptions options;
    options.seed = seed;
    options.keyframes_per_segment = 20;
    if (seed > 7) options.session_age_s = 100;
    c.segment =
        OneSegment(c.rig, c.theta0, *MakeHandheld(2.2, 1, seed), options).slam;
    c.gauge = static_cast<int>(seed) - 5;
    cases.push_back(c);
  }
  return cases;
}

// Truth, and a SLAM system with a factory calibration and noise.
std::vector<Case> WellConditionedCases() {
  std::vector<Case> cases;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Case c;
    c.rig = seed % 2 ? HandheldRig("handheld") : TwoCameraRig();
    c.theta0 = c.rig.factory;
    SimulationOptions options;
    options.keyframes_per_segment = seed == 1 ? 40 : 20;
    c.segment = MovingSegment(c.rig, seed, options);
    c.gauge = static_cast<int>(seed) - 1;
    cases.push_back(c);

    options.seed = seed;
    c.theta0 = PerturbCalibration(c.rig.factory, {}, seed);
    c.segment =
        OneSegment(c.rig, c.theta0, *MakeHandheld(4.1, 1, seed), options).slam;
    cases.push_back(c);
  }
  for (std::uint64_t seed = 11; seed <= 12; ++seed) {
    // Two IMUs, at the truth and off it.
    Case c;
    c.rig = HandheldRig("handheld");
    AddSecondImu(&c.rig);
    c.rig.blocks = {{"imu1.time_offset", true}};
    c.rig.factory.imu1->time_offset_s = 2e-3;
    c.theta0 = c.rig.factory;
    if (seed > 11) c.theta0 = PerturbCalibration(c.rig.factory, {}, seed);
    SimulationOptions options;
    options.seed = seed;
    options.keyframes_per_segment = 20;
    c.segment =
        OneSegment(c.rig, c.theta0, *MakeHandheld(2.2, 1, seed), options).slam;
    StartSecondImu(c.theta0, &c.segment);
    c.gauge = static_cast<int>(seed) - 11;
    cases.push_back(c);
  }
  // Some parameters held by the rig.
  cases[0].rig.fixed = {"cam0.distortion.*", "imu.q_AI.y"};
  for (const Case& c : TimeOffsetCases()) cases.push_back(c);
  return cases;
}

Eigen::VectorXd ThetaScale(const Rig& rig) {
  const std::vector<int> free = FreeComponents(rig);
  Eigen::VectorXd scale = Eigen::VectorXd::Zero(PriorSigmas(rig).size());
  scale(free) = PriorSigmas(rig)(free);
  return scale;
}

TEST(ScoreAgainstReference, EqualsTheSparseQrOfTheWholeJacobian) {
  for (const Case& c : WellConditionedCases()) {
    ScoreOptions options;
    options.gauge_keyframe = c.gauge;
    const SegmentInformation score =
        ScoreSegment(c.rig, c.theta0, c.segment, options);
    const InlierSelection selection =
        SelectInliers(c.rig, c.theta0, c.segment, options);
    SparseQr qr(BuildSegmentJacobian(
        c.rig, c.theta0, c.segment, selection, ThetaScale(c.rig), c.gauge));
    qr.Factorise();
    const ThetaRoot root = qr.Root();
    const std::vector<double> entropies = ReferenceEntropies(c.rig, root.R);
    ASSERT_EQ(score.groups.size(), entropies.size());
    for (std::size_t q = 0; q < entropies.size(); ++q) {
      EXPECT_NEAR(score.groups[q].entropy,
                  entropies[q],
                  kAgreement * std::abs(entropies[q]));
    }
    // In units of the prior.
    const std::vector<int> free = FreeComponents(c.rig);
    const Eigen::VectorXd unit = PriorSigmas(c.rig)(free);
    const Eigen::MatrixXd Lambda =
        unit.asDiagonal() * score.Lambda(free, free) * unit.asDiagonal();
    const Eigen::MatrixXd expected = root.R.transpose() * root.R;
    EXPECT_LT((Lambda - expected).norm(), 1e-9 * expected.norm());
    const Eigen::VectorXd eta = unit.cwiseProduct(score.eta(free));
    const Eigen::VectorXd expected_eta = -root.R.transpose() * root.c;
    EXPECT_LT((eta - expected_eta).norm(),
              1e-7 * expected_eta.norm() + 1e-7 * expected.norm());
  }
}

TEST(ScoreAgainstReference, EqualsCeresCovariance) {
  for (const Case& c : WellConditionedCases()) {
    ScoreOptions options;
    options.gauge_keyframe = c.gauge;
    const SegmentInformation score =
        ScoreSegment(c.rig, c.theta0, c.segment, options);
    const InlierSelection selection =
        SelectInliers(c.rig, c.theta0, c.segment, options);
    const Eigen::MatrixXd posterior =
        CeresSegment(c.rig, c.theta0, c.segment, selection, c.gauge)
            .Posterior();
    ASSERT_GT(posterior.size(), 0);
    const std::vector<int> free = FreeComponents(c.rig);
    const Eigen::VectorXd prior = PriorSigmas(c.rig);
    const Eigen::VectorXd reference = ReferenceSigmas(c.rig);
    for (std::size_t q = 0; q < c.rig.groups.size(); ++q) {
      const std::vector<int> components =
          GroupComponents(c.rig, c.rig.groups[q]);
      std::vector<int> at;
      for (const int i : components) {
        at.push_back(static_cast<int>(
            std::lower_bound(free.begin(), free.end(), i) - free.begin()));
      }
      const Eigen::VectorXd sigma_ref =
          reference(components).cwiseQuotient(prior(components));
      const double entropy = Entropy(posterior(at, at), sigma_ref);
      EXPECT_NEAR(
          score.groups[q].entropy, entropy, kAgreement * std::abs(entropy));
    }
  }
}

// eta moves theta towards the truth: linearised off the truth, with true
// states, its step differs by exactly this offset from the step at the truth
// (which is not zero: the IMU is sampled, its integral is not exact).
TEST(ScoreAgainstReference, TheStepFromEtaTakesBackAnErrorOfTheta) {
  Rig rig = HandheldRig("handheld");
  rig.blocks = {{"*.time_offset", true}};
  const Eigen::VectorXd sigma = ReferenceSigmas(rig);
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 1e-3);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const MotionSegment segment = MovingSegment(rig, seed);
    const auto step = [&](const Calibration& theta0) {
      const SegmentInformation score = ScoreSegment(rig, theta0, segment);
      const Eigen::MatrixXd Lambda =
          sigma.asDiagonal() * score.Lambda * sigma.asDiagonal();
      return Lambda.ldlt().solve(sigma.cwiseProduct(score.eta)).eval();
    };
    Eigen::VectorXd error(sigma.size());
    for (double& x : error) x = normal(random);
    const Calibration off = BoxPlus(rig.factory, sigma.cwiseProduct(error));
    const Eigen::VectorXd taken_back = step(rig.factory) - step(off);
    EXPECT_LT((taken_back - error).norm(), 0.05 * error.norm());
  }
}

}  // namespace
}  // namespace selfcal
