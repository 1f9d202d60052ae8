#include "core/information/fusion.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "core/model/so3.h"
#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

Eigen::VectorXd Normal(int size, std::mt19937* random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd values(size);
  for (double& x : values) x = normal(*random);
  return values;
}

// The rig with estimated time offsets: nothing is held.
Rig AllEstimated(Rig rig) {
  rig.blocks = {{"*.time_offset", true}};
  return rig;
}

// Information of a linear segment that was scored at theta0, with theta at the
// truth: information of a given rank, in units of the prior, with its noise.
SegmentInformation LinearSegment(const Rig& rig,
                                 const Calibration& theta0,
                                 const Calibration& theta,
                                 int rank,
                                 double scale,
                                 double noise,
                                 std::mt19937* random) {
  const int size = TangentSize(theta0);
  const Eigen::VectorXd unit = PriorSigmas(rig).cwiseInverse();
  Eigen::MatrixXd root(rank, size);
  for (auto& x : root.reshaped()) x = scale * Normal(1, random)[0];
  root = root * unit.asDiagonal();
  SegmentInformation information;
  information.theta0 = theta0;
  information.Lambda = root.transpose() * root;
  information.eta = information.Lambda * BoxMinus(theta, theta0) +
                    noise * root.transpose() * Normal(rank, random);
  return information;
}

Calibration Moved(const Rig& rig,
                  const Calibration& theta,
                  double sigmas,
                  std::mt19937* random) {
  const Eigen::VectorXd prior = PriorSigmas(rig);
  return BoxPlus(theta,
                 sigmas * prior.cwiseProduct(
                              Normal(static_cast<int>(prior.size()), random)));
}

TEST(Transport, ToItsOwnPointChangesNothing) {
  std::mt19937 random(1);
  const Rig rig = AllEstimated(TwoCameraRig());
  const SegmentInformation information =
      LinearSegment(rig, rig.factory, rig.factory, 20, 5, 1, &random);
  const ThetaInformation same = Transport(information, rig.factory);
  EXPECT_TRUE(same.Lambda.isApprox(information.Lambda, 1e-12));
  EXPECT_TRUE(same.eta.isApprox(information.eta, 1e-12));
}

// The cost 1/2 |theta [-] theta0 - d|^2_Lambda as a function on the manifold
// does not depend on the point about which it is written: its gradient and, at
// its minimum, its curvature are those of differences.
TEST(Transport, KeepsTheGradientOfTheCost) {
  std::mt19937 random(2);
  const Rig rig = AllEstimated(HandheldRig("handheld"));
  const int size = TangentSize(rig.factory);
  for (int trial = 0; trial < 100; ++trial) {
    const Calibration theta0 = Moved(rig, rig.factory, 1, &random);
    const Calibration truth = Moved(rig, rig.factory, 1, &random);
    const Calibration point = Moved(rig, rig.factory, 1, &random);
    const SegmentInformation information =
        LinearSegment(rig, theta0, truth, size, 3, 1, &random);
    const auto cost = [&](const Calibration& theta) {
      const Eigen::VectorXd d = BoxMinus(theta, theta0);
      return 0.5 * d.dot(information.Lambda * d) - information.eta.dot(d);
    };
    const ThetaInformation there = Transport(information, point);
    const Eigen::VectorXd unit = PriorSigmas(rig);
    for (int i = 0; i < size; ++i) {
      Eigen::VectorXd step = Eigen::VectorXd::Zero(size);
      step[i] = 1e-4 * unit[i];
      const double slope =
          (cost(BoxPlus(point, step)) - cost(BoxPlus(point, -step))) / 2e-4;
      const double scale = unit[i] * there.eta.cwiseAbs().maxCoeff();
      EXPECT_NEAR(slope, -there.eta[i] * unit[i], 1e-6 * (1 + scale));
    }
  }
}

// Without noise, wherever each was linearised, all agree on the truth.
TEST(Fuse, FindsTheTruthOfLinearSegmentsScoredAtDifferentCalibrations) {
  std::mt19937 random(3);
  for (const Rig& rig :
       {AllEstimated(HandheldRig("handheld")), AllEstimated(TwoCameraRig())}) {
    const Calibration truth = Moved(rig, rig.factory, 0.5, &random);
    std::vector<SegmentInformation> segments;
    for (int i = 0; i < 12; ++i) {
      const Calibration theta0 = Moved(rig, rig.factory, 0.3, &random);
      segments.push_back(
          LinearSegment(rig, theta0, truth, 10, 1e5, 0, &random));
    }
    const FusedEstimate fused = Fuse(rig, segments);
    EXPECT_EQ(fused.rank, TangentSize(rig.factory));
    EXPECT_TRUE(fused.unobserved.empty());
    EXPECT_EQ(fused.segments, 12);
    const Eigen::VectorXd error =
        BoxMinus(fused.theta, truth).cwiseQuotient(PriorSigmas(rig));
    EXPECT_LT(error.lpNorm<Eigen::Infinity>(), 1e-7);
  }
}

// Truth drawn from the prior, noise as modelled: the error of the estimate has
// its covariance, and the segments differ as their information predicts.
TEST(Fuse, IsConsistentWhereAllIsLinear) {
  std::mt19937 random(4);
  const Rig rig = AllEstimated(HandheldRig("handheld"));
  const int size = TangentSize(rig.factory);
  constexpr int kTrials = 300;
  double nees = 0, heterogeneity = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Calibration truth = Moved(rig, rig.factory, 1, &random);
    std::vector<SegmentInformation> segments;
    for (int i = 0; i < 5; ++i) {
      const Calibration theta0 = Moved(rig, truth, 0.3, &random);
      segments.push_back(LinearSegment(rig, theta0, truth, 9, 4, 1, &random));
    }
    const FusedEstimate fused = Fuse(rig, segments);
    const Eigen::VectorXd error = BoxMinus(truth, fused.theta);
    nees += error.dot(fused.covariance.llt().solve(error)) / kTrials;
    heterogeneity += fused.heterogeneity / kTrials;
  }
  // A mean of chi-squares of `size`: five standard errors.
  EXPECT_NEAR(nees, size, 5 * std::sqrt(2.0 * size / kTrials));
  EXPECT_NEAR(heterogeneity, 1, 0.05);
}

TEST(Fuse, HeterogeneityIsTheScaleOfTheVariance) {
  std::mt19937 random(5);
  const Rig rig = AllEstimated(HandheldRig("handheld"));
  for (const double noise : {0.5, 1.0, 3.0}) {
    double mean = 0;
    for (int trial = 0; trial < 50; ++trial) {
      std::vector<SegmentInformation> segments;
      for (int i = 0; i < 10; ++i) {
        segments.push_back(LinearSegment(
            rig, rig.factory, rig.factory, 20, 30, noise, &random));
      }
      mean += Fuse(rig, segments).heterogeneity / 50;
    }
    EXPECT_NEAR(mean, noise * noise, 0.1 * noise * noise);
  }
}

TEST(Fuse, ReachIsTheDistanceFromTheFarthestScore) {
  std::mt19937 random(7);
  const Rig rig = AllEstimated(HandheldRig("handheld"));
  const Eigen::VectorXd unit = ReferenceSigmas(rig);
  std::vector<SegmentInformation> segments;
  for (const double sigmas : {0.1, -0.7, 0.3}) {
    const Calibration theta0 = BoxPlus(rig.factory, sigmas * unit);
    segments.push_back(
        LinearSegment(rig, theta0, rig.factory, 1000, 1000, 1e-3, &random));
  }
  EXPECT_NEAR(Fuse(rig, segments).reach, 0.7, 0.02);
}

TEST(Fuse, WithoutSegmentsIsThePrior) {
  const Rig rig = AllEstimated(HandheldRig("handheld"));
  const FusedEstimate fused = Fuse(rig, {});
  EXPECT_EQ(fused.rank, 0);
  EXPECT_EQ(fused.segments, 0);
  EXPECT_EQ(fused.heterogeneity, 0);
  EXPECT_EQ(fused.reach, 0);
  EXPECT_EQ(static_cast<int>(fused.unobserved.size()),
            TangentSize(rig.factory));
  // With fused multiply-add, as on arm64, a rotation times its inverse is the
  // identity only to rounding: 2e-17.
  EXPECT_LT(BoxMinus(fused.theta, rig.factory).norm(), 1e-15);
  const Eigen::MatrixXd prior = PriorSigmas(rig).cwiseAbs2().asDiagonal();
  EXPECT_TRUE(fused.covariance.isApprox(prior, 1e-12));
}

// Stored information does not contain the prior: with another mean, the same
// segments give the closed form, as in a rig that was created with this mean.
TEST(Fuse, FollowsAChangedPriorMean) {
  std::mt19937 random(8);
  // Small enough that the curvature of rotations does not matter.
  constexpr double kSmall = 1e-6;
  const Rig rig = AllEstimated(HandheldRig("handheld"));
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  const Calibration truth = Moved(rig, rig.factory, kSmall, &random);
  const std::vector<SegmentInformation> segments = {
      LinearSegment(rig, rig.factory, truth, 9, 4, kSmall, &random),
      LinearSegment(rig, rig.factory, truth, 9, 4, kSmall, &random)};
  Rig given = rig;
  given.prior_mean = Moved(rig, rig.factory, kSmall, &random);
  const Eigen::VectorXd mean = BoxMinus(*given.prior_mean, rig.factory);
  const Eigen::MatrixXd prior = sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
  const Eigen::MatrixXd Lambda =
      prior + segments[0].Lambda + segments[1].Lambda;
  const Eigen::MatrixXd covariance =
      sigmas.asDiagonal() *
      Eigen::MatrixXd(sigmas.asDiagonal() * Lambda * sigmas.asDiagonal())
          .inverse() *
      sigmas.asDiagonal();
  const Eigen::VectorXd expected =
      covariance * (prior * mean + segments[0].eta + segments[1].eta);
  const FusedEstimate fused = Fuse(given, segments);
  const auto off = [&](const Calibration& theta, const Eigen::VectorXd& from) {
    return (BoxMinus(theta, rig.factory) - from).cwiseQuotient(sigmas).norm();
  };
  EXPECT_LT(off(fused.theta, expected), 1e-4 * kSmall);
  EXPECT_GT(off(Fuse(rig, segments).theta, expected), 0.1 * kSmall);
  EXPECT_TRUE(fused.covariance.isApprox(covariance, 1e-5));
  Rig created = rig;
  created.factory = *given.prior_mean;
  const FusedEstimate same = Fuse(created, segments);
  EXPECT_LT(BoxMinus(same.theta, fused.theta).norm(), 1e-15);
  EXPECT_TRUE(same.covariance.isApprox(fused.covariance, 1e-12));
}

TEST(Fuse, FixedComponentsDoNotChange) {
  std::mt19937 random(6);
  Rig rig = HandheldRig("handheld");
  rig.fixed = {"imu.*", "cam0.p_CI.x"};
  const std::vector<int> free = FreeComponents(rig);
  std::vector<SegmentInformation> segments;
  for (int i = 0; i < 3; ++i) {
    SegmentInformation information =
        LinearSegment(rig, rig.factory, rig.factory, 26, 10, 1, &random);
    const std::vector<int> fixed =
        MatchComponents(TangentComponents(rig.factory), rig.fixed);
    for (const int k : fixed) {
      information.Lambda.row(k).setZero();
      information.Lambda.col(k).setZero();
      information.eta[k] = 0;
    }
    segments.push_back(information);
  }
  const FusedEstimate fused = Fuse(rig, segments);
  EXPECT_EQ(fused.rank, static_cast<int>(free.size()));
  const Eigen::VectorXd moved = BoxMinus(fused.theta, rig.factory);
  for (const int k :
       MatchComponents(TangentComponents(rig.factory), rig.fixed)) {
    EXPECT_NEAR(moved[k], 0, 1e-15);
    EXPECT_EQ(fused.covariance(k, k), 0);
  }
  EXPECT_GT(moved.norm(), 0);
}

// Real factors, a SLAM system that is right: one step from a calibration that
// is slightly off leads to the truth within a few sigma, a smaller error than
// the step itself.
TEST(Fuse, StepsToTheTruthOfSimulatedSegments) {
  const Rig rig = HandheldRig("handheld");
  CalibrationError error;
  error.focal_relative *= 0.1;
  error.principal_point_px *= 0.1;
  error.distortion_relative *= 0.1;
  error.camera_rotation_rad *= 0.1;
  error.camera_position_m *= 0.1;
  error.scale *= 0.1;
  error.misalignment *= 0.1;
  error.accel_rotation_rad *= 0.1;
  const Calibration theta_slam = PerturbCalibration(rig.factory, error, 3);
  Rig sold = rig;
  sold.factory = theta_slam;
  const SimulatedSession session = Simulate(
      rig, rig.factory, theta_slam, *MakeHandheld(40.1, 1, 3), "session", {});
  std::vector<SegmentInformation> segments;
  for (const MotionSegment& segment : session.segments) {
    segments.push_back(ScoreSegment(sold, theta_slam, segment));
  }
  ASSERT_EQ(segments.size(), 10u);
  const FusedEstimate fused = Fuse(sold, segments);
  EXPECT_EQ(fused.rank, static_cast<int>(FreeComponents(rig).size()));
  const Eigen::VectorXd scale = PriorSigmas(rig).cwiseInverse();
  const double before =
      scale.cwiseProduct(BoxMinus(theta_slam, rig.factory)).norm();
  const double after =
      scale.cwiseProduct(BoxMinus(fused.theta, rig.factory)).norm();
  EXPECT_LT(after, before / 2);
}

}  // namespace
}  // namespace selfcal
