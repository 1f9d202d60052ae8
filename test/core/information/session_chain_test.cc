#include "core/information/session_chain.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "core/information/segment_information.h"
#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

// Standard deviations with the prior of the rig, in its units.
Eigen::VectorXd Sigmas(const Rig& rig, const Eigen::MatrixXd& Lambda) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig)(free);
  Eigen::MatrixXd information =
      prior.asDiagonal() * Lambda(free, free) * prior.asDiagonal();
  information.diagonal().array() += 1;
  return information.inverse().diagonal().cwiseSqrt();
}

// The estimate with that prior about `point`, in its units.
Eigen::VectorXd Estimate(const Rig& rig, const ThetaInformation& sum) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig)(free);
  Eigen::MatrixXd information =
      prior.asDiagonal() * sum.Lambda(free, free) * prior.asDiagonal();
  information.diagonal().array() += 1;
  return information.llt().solve(prior.cwiseProduct(sum.eta(free)));
}

void ExpectSame(const Rig& rig,
                const ThetaInformation& a,
                const ThetaInformation& b) {
  const Eigen::VectorXd sigmas = Sigmas(rig, b.Lambda);
  EXPECT_LT((Sigmas(rig, a.Lambda) - sigmas)
                .cwiseQuotient(sigmas)
                .lpNorm<Eigen::Infinity>(),
            1e-4);
  EXPECT_LT((Estimate(rig, a) - Estimate(rig, b))
                .cwiseQuotient(sigmas)
                .lpNorm<Eigen::Infinity>(),
            1e-3);
}

// Segments of a hand-held session under a calibration that is wrong, so that
// there is something to estimate; without noise, so that nothing is outlying.
std::vector<MotionSegment> Session(const Rig& rig, int keyframes) {
  SimulationOptions options;
  options.noise = false;
  options.keyframes_per_segment = keyframes;
  options.landmarks_in_view = 40;
  options.revisit_fraction = 0;
  CalibrationError error;
  error.focal_relative = 1e-3;
  error.principal_point_px = 0.2;
  error.distortion_relative = 1e-3;
  error.camera_rotation_rad = error.accel_rotation_rad = 1e-3;
  error.camera_position_m = error.scale = error.misalignment = 1e-3;
  const Calibration truth = PerturbCalibration(rig.factory, error, 3);
  return Simulate(rig,
                  truth,
                  rig.factory,
                  *MakeHandheld(6.2, 1, 5),
                  "session",
                  options)
      .segments;
}

// Concatenates two segments; common landmarks become different ones.
MotionSegment Concatenated(const MotionSegment& a, const MotionSegment& b) {
  MotionSegment both = a;
  const auto keyframes = static_cast<std::int32_t>(a.keyframes.size());
  const auto landmarks = static_cast<std::int32_t>(a.landmarks.size());
  both.keyframes.insert(
      both.keyframes.end(), b.keyframes.begin(), b.keyframes.end());
  for (const ImuSample& sample : b.imu) {
    if (sample.t_ns > both.imu.back().t_ns) both.imu.push_back(sample);
  }
  for (Landmark landmark : b.landmarks) {
    landmark.id += 1'000'000;
    both.landmarks.push_back(landmark);
  }
  for (Observation o : b.observations) {
    o.keyframe += keyframes;
    o.landmark += landmarks;
    both.observations.push_back(o);
  }
  return both;
}

ThetaInformation Scored(const Rig& rig, const MotionSegment& segment) {
  const SegmentInformation score = ScoreSegment(rig, rig.factory, segment);
  return {score.Lambda, score.eta};
}

TEST(SessionChain, OneSegmentGivesTheInformationOfItsScore) {
  for (const Rig& rig : {HandheldRig("one"), TwoCameraRig()}) {
    const MotionSegment segment = Session(rig, 30)[0];
    SessionChain chain(rig, rig.factory);
    chain.Add(SummariseEnds(rig, rig.factory, segment));
    ExpectSame(rig, chain.Theta(), Scored(rig, segment));
  }
}

TEST(SessionChain, NeighboursGiveTheInformationOfOneSegment) {
  const Rig rig = HandheldRig("r");
  const std::vector<MotionSegment> segments = Session(rig, 20);
  ASSERT_GE(segments.size(), 3u);
  SessionChain chain(rig, rig.factory);
  MotionSegment whole;
  ThetaInformation apart = {Eigen::MatrixXd::Zero(27, 27), {}};
  for (int i = 0; i < 3; ++i) {
    chain.Add(SummariseEnds(rig, rig.factory, segments[i]));
    whole = i == 0 ? segments[0] : Concatenated(whole, segments[i]);
    apart.Lambda += Scored(rig, segments[i]).Lambda;
  }
  ExpectSame(rig, chain.Theta(), Scored(rig, whole));
  // The joint information exceeds that of the single segments.
  const Eigen::VectorXd gained =
      Sigmas(rig, apart.Lambda)
          .cwiseQuotient(Sigmas(rig, chain.Theta().Lambda));
  EXPECT_GT(gained.minCoeff(), 1);
  EXPECT_GT(gained.maxCoeff(), 1.2);
}

// If the point differs from the linearisation point, the chain is about the
// point, and its estimate is the same calibration.
TEST(SessionChain, IsAboutItsPoint) {
  const Rig rig = HandheldRig("r");
  const MotionSegment segment = Session(rig, 30)[0];
  const SegmentEnds ends = SummariseEnds(rig, rig.factory, segment);
  SegmentInformation score = ScoreSegment(rig, rig.factory, segment);
  const Calibration point = PerturbCalibration(rig.factory, {}, 8);
  SessionChain chain(rig, point);
  chain.Add(ends);
  ExpectSame(rig, chain.Theta(), Transport(score, point));
}

// Segments with a missing one in between share the information that biases walk
// slowly; those of another session do not.
TEST(SessionChain, OverAGapTiesTheBiases) {
  const Rig rig = HandheldRig("r");
  const std::vector<MotionSegment> segments = Session(rig, 20);
  const auto sigmas = [&](const std::string& session, const Rig& used) {
    SessionChain chain(used, used.factory);
    SegmentEnds later = SummariseEnds(used, used.factory, segments[2]);
    later.key.session = session;
    chain.Add(SummariseEnds(used, used.factory, segments[0]));
    chain.Add(later);
    return Sigmas(used, chain.Theta().Lambda);
  };
  const Eigen::VectorXd other = sigmas("other", rig);
  const Eigen::VectorXd sum = Sigmas(
      rig, Scored(rig, segments[0]).Lambda + Scored(rig, segments[2]).Lambda);
  EXPECT_LT((other - sum).cwiseQuotient(sum).lpNorm<Eigen::Infinity>(), 1e-4);
  const Eigen::VectorXd tied = sigmas("session", rig);
  EXPECT_LT(tied.cwiseQuotient(other).maxCoeff(), 1 + 1e-6);
  EXPECT_LT(tied.cwiseQuotient(other).minCoeff(), 0.95);
}

TEST(SessionChain, AWeightIsOneOverAFactorOnTheCovariance) {
  const Rig rig = HandheldRig("r");
  const SegmentEnds ends = SummariseEnds(rig, rig.factory, Session(rig, 30)[0]);
  SessionChain whole(rig, rig.factory), quarter(rig, rig.factory);
  whole.Add(ends);
  quarter.Add(ends, 0.25);
  ThetaInformation expected = whole.Theta();
  expected.Lambda *= 0.25;
  expected.eta *= 0.25;
  ExpectSame(rig, quarter.Theta(), expected);
}

// The covariance of the estimate grows by the variances of the walk, and the
// estimate does not change.
TEST(SessionChain, AgesByTheWalk) {
  Rig rig = HandheldRig("r");
  SessionChain chain(rig, rig.factory);
  for (const MotionSegment& segment : Session(rig, 20)) {
    chain.Add(SummariseEnds(rig, rig.factory, segment));
  }
  const ThetaInformation before = chain.Theta();
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd unit = ReferenceSigmas(rig)(free);
  Eigen::VectorXd variances = Eigen::VectorXd::Zero(TangentSize(rig.factory));
  variances(free) = (0.3 * unit).cwiseAbs2();
  variances(free[0]) = 0;  // which does not walk
  chain.Age(variances);
  const ThetaInformation after = chain.Theta();
  const auto covariance = [&](const ThetaInformation& information) {
    return Eigen::MatrixXd(unit.asDiagonal() * information.Lambda(free, free) *
                           unit.asDiagonal())
        .inverse()
        .eval();
  };
  const Eigen::VectorXd walked =
      variances(free).cwiseQuotient(unit.cwiseAbs2());
  EXPECT_LT((covariance(after) - covariance(before) -
             Eigen::MatrixXd(walked.asDiagonal()))
                .norm(),
            1e-6 * covariance(after).norm());
  const auto estimate = [&](const ThetaInformation& information) {
    return (covariance(information) * unit.cwiseProduct(information.eta(free)))
        .eval();
  };
  EXPECT_LT((estimate(after) - estimate(before)).norm(),
            1e-6 * estimate(before).norm());
}

}  // namespace
}  // namespace selfcal
