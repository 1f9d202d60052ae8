#include "core/calibration/settled_ends.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <vector>

#include "core/information/segment_information.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

class SettledEndsTest : public ::testing::Test {
 protected:
  SettledEndsTest() : truth_(rig_.factory) {
    rig_.factory = PerturbCalibration(truth_, {}, 1);
    segment_ = Simulated(*MakeHandheld(4.5, 1, 5));
  }

  MotionSegment Simulated(const Trajectory& motion) const {
    SimulationOptions options;
    options.seed = 5;
    options.keyframes_per_segment = 20;
    options.landmarks_in_view = 60;
    return Simulate(rig_, truth_, rig_.factory, motion, "session", options)
        .segments.at(0);
  }

  // States of a filter whose scale is wrong by a factor.
  MotionSegment Scaled(double factor) const {
    MotionSegment scaled = segment_;
    for (KeyframeState& state : scaled.keyframes) {
      state.p_GI *= factor;
      state.v_GI *= factor;
    }
    for (Landmark& landmark : scaled.landmarks) landmark.p_G *= factor;
    return scaled;
  }

  // Distance of estimates of theta, with the prior; over the free components,
  // in sigmas of `a`.
  double Distance(const MotionSegment& a, const MotionSegment& b) const {
    const std::vector<int> free = FreeComponents(rig_);
    const Eigen::MatrixXd prior =
        PriorSigmas(rig_)(free).cwiseAbs2().cwiseInverse().asDiagonal();
    const auto estimate = [&](const MotionSegment& segment,
                              Eigen::MatrixXd* covariance) {
      const SegmentInformation information =
          ScoreSegment(rig_, truth_, segment);
      *covariance =
          (information.Lambda(free, free) + prior)
              .llt()
              .solve(Eigen::MatrixXd::Identity(prior.rows(), prior.cols()));
      return (*covariance * information.eta(free)).eval();
    };
    Eigen::MatrixXd covariance, other;
    const Eigen::VectorXd difference =
        estimate(a, &covariance) - estimate(b, &other);
    return difference.cwiseQuotient(covariance.diagonal().cwiseSqrt())
        .lpNorm<Eigen::Infinity>();
  }

  Rig rig_ = HandheldRig("r");
  Calibration truth_;
  MotionSegment segment_;
};

TEST_F(SettledEndsTest, IsTheSameWhateverTheInitialStates) {
  for (const double factor : {0.7, 1 / 0.7}) {
    const MotionSegment scaled = Scaled(factor);
    EXPECT_GT(Distance(segment_, scaled), 0.5) << factor;
    EXPECT_LT(Distance(SettleSegment(rig_, truth_, segment_),
                       SettleSegment(rig_, truth_, scaled)),
              0.1)
        << factor;
  }
}

TEST_F(SettledEndsTest, ASegmentAtItsMinimumDoesNotChange) {
  const MotionSegment settled = SettleSegment(rig_, truth_, segment_);
  EXPECT_LT(Distance(settled, SettleSegment(rig_, truth_, settled)), 0.02);
}

// The others are summarised unchanged, in a fraction of the time.
TEST_F(SettledEndsTest, OnlyStatesThatAreFarOffAreSettled) {
  EXPECT_FALSE(IsFarFromMinimum(SummariseEnds(rig_, truth_, segment_)));
  const SegmentEnds sound = SummariseSettledEnds(rig_, truth_, segment_);
  EXPECT_EQ(sound.last.v_GI, segment_.keyframes.back().v_GI);
  for (const double factor : {0.7, 1 / 0.7}) {
    const MotionSegment scaled = Scaled(factor);
    EXPECT_TRUE(IsFarFromMinimum(SummariseEnds(rig_, truth_, scaled)))
        << factor;
    const SegmentEnds settled = SummariseSettledEnds(rig_, truth_, scaled);
    EXPECT_FALSE(IsFarFromMinimum(settled)) << factor;
    EXPECT_LT((settled.last.v_GI - segment_.keyframes.back().v_GI).norm(), 0.1)
        << factor;
  }
}

TEST_F(SettledEndsTest, TheDataIsUnchanged) {
  const MotionSegment settled = SettleSegment(rig_, truth_, Scaled(0.7));
  EXPECT_EQ(settled.key, segment_.key);
  EXPECT_EQ(settled.imu.size(), segment_.imu.size());
  ASSERT_EQ(settled.observations.size(), segment_.observations.size());
  for (std::size_t i = 0; i < settled.observations.size(); ++i) {
    EXPECT_EQ(settled.observations[i].z_px, segment_.observations[i].z_px);
  }
  ASSERT_EQ(settled.landmarks.size(), segment_.landmarks.size());
  for (std::size_t i = 0; i < settled.landmarks.size(); ++i) {
    EXPECT_EQ(settled.landmarks[i].id, segment_.landmarks[i].id);
  }
  for (std::size_t i = 0; i < settled.keyframes.size(); ++i) {
    EXPECT_EQ(settled.keyframes[i].t_ns, segment_.keyframes[i].t_ns);
  }
  EXPECT_TRUE(Validate(settled, rig_.factory).empty());
}

// At rest no landmark has a depth.
TEST_F(SettledEndsTest, WithoutMotionItStaysUsable) {
  const MotionSegment resting = Simulated(*MakeRest(4.5));
  const MotionSegment settled = SettleSegment(rig_, rig_.factory, resting);
  EXPECT_TRUE(Validate(settled, rig_.factory).empty());
  const SegmentInformation information =
      ScoreSegment(rig_, rig_.factory, settled);
  EXPECT_TRUE(information.Lambda.allFinite());
  EXPECT_LT(information.residuals.fit, 1.5);
}

}  // namespace
}  // namespace selfcal
