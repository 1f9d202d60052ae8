#include "core/calibration/evicted_prior.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// A session of eight segments.
class EvictedPriorTest : public ::testing::Test {
 protected:
  EvictedPriorTest() : truth_(rig_.factory) {
    rig_.factory = PerturbCalibration(truth_, {}, 1);
    SimulationOptions options;
    options.seed = 5;
    options.keyframes_per_segment = 20;
    options.landmarks_in_view = 60;
    options.revisit_fraction = 0;
    segments_ = Simulate(rig_,
                         truth_,
                         rig_.factory,
                         *MakeHandheld(16.5, 1, 5),
                         "session",
                         options)
                    .segments;
  }

  // All segments, linearised there.
  void SummariseAt(const Calibration& theta) {
    ends_.clear();
    for (const MotionSegment& segment : segments_) {
      ends_.push_back(SummariseEnds(rig_, theta, segment));
    }
  }

  std::vector<RememberedSegment> Remembered(
      const std::vector<int>& with_data) const {
    std::vector<RememberedSegment> all;
    for (const SegmentEnds& ends : ends_) {
      all.push_back({.ends = &ends, .time_ns = ends.first.t_ns});
    }
    for (const int i : with_data) all[i].calibrated_on = true;
    return all;
  }

  CalibrationResult CalibrateOn(const std::vector<int>& set,
                                std::optional<ThetaPrior> prior) const {
    std::vector<MotionSegment> picked;
    for (const int i : set) picked.push_back(segments_[i]);
    CalibrateOptions options;
    options.noise_factors = false;
    options.prior = std::move(prior);
    return Calibrate(rig_, rig_.factory, picked, options);
  }

  // Of the free components.
  Eigen::VectorXd Sigmas(const CalibrationResult& result) const {
    return result.covariance.diagonal()(FreeComponents(rig_)).cwiseSqrt();
  }

  double InPriorUnits(const Eigen::MatrixXd& information, bool smallest) const {
    const std::vector<int> free = FreeComponents(rig_);
    const Eigen::VectorXd scale = PriorSigmas(rig_)(free);
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(
            scale.asDiagonal() * information(free, free) * scale.asDiagonal())
            .eigenvalues();
    return smallest ? values.minCoeff() : values.maxCoeff();
  }

  const std::vector<int> kept_ = {1, 2, 5};
  Rig rig_ = HandheldRig("r");
  Calibration truth_;
  std::vector<MotionSegment> segments_;
  std::vector<SegmentEnds> ends_;
};

// The reference is a calibration on the data of all segments.
TEST_F(EvictedPriorTest, WithItAFewSegmentsSayWhatAllDo) {
  ASSERT_EQ(segments_.size(), 8u);
  std::vector<int> all;
  for (int i = 0; i < 8; ++i) all.push_back(i);
  const CalibrationResult batch = CalibrateOn(all, std::nullopt);
  const CalibrationResult alone = CalibrateOn(kept_, std::nullopt);
  ASSERT_EQ(batch.status, CalibrateStatus::kConverged);
  ASSERT_EQ(alone.status, CalibrateStatus::kConverged);
  SummariseAt(alone.theta);
  const EvictedPrior evicted =
      PriorOfEvicted(rig_, alone.theta, Remembered(kept_));
  EXPECT_EQ(evicted.segments, 5);
  EXPECT_EQ(evicted.left_out, 0);
  EXPECT_EQ(evicted.reach, 0);
  const CalibrationResult informed = CalibrateOn(kept_, evicted.prior);
  ASSERT_EQ(informed.status, CalibrateStatus::kConverged);
  const Eigen::VectorXd ratio = Sigmas(informed).cwiseQuotient(Sigmas(batch));
  EXPECT_GT(Sigmas(alone).cwiseQuotient(Sigmas(batch)).minCoeff(), 1.2);
  // Landmarks that continue are worth the rest.
  EXPECT_LT(ratio.maxCoeff(), 1.15);
  EXPECT_GT(ratio.minCoeff(), 0.98);
  // What is known less cannot move the estimate by more than a part of the
  // sigma, squared differences 1.15^2 - 1 of the variance: 0.57, at 3 sigma.
  const Eigen::VectorXd moved =
      BoxMinus(informed.theta, batch.theta)(FreeComponents(rig_));
  EXPECT_LT(moved.cwiseQuotient(Sigmas(batch)).lpNorm<Eigen::Infinity>(), 1.7);
  // The information of the result is that of its own data.
  EXPECT_LT(InPriorUnits(informed.Lambda, false),
            1.05 * InPriorUnits(alone.Lambda, false));
}

TEST_F(EvictedPriorTest, IsNothingWhereAllSegmentsHaveTheirData) {
  SummariseAt(truth_);
  const EvictedPrior evicted =
      PriorOfEvicted(rig_, truth_, Remembered({0, 1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(evicted.segments, 0);
  EXPECT_TRUE(evicted.prior.information.isZero());
  EXPECT_TRUE(BoxMinus(evicted.prior.centre, truth_).isZero());
}

// Data never takes information away.
TEST_F(EvictedPriorTest, IsSemidefiniteWhateverHasData) {
  SummariseAt(truth_);
  for (const std::vector<int>& set :
       {std::vector<int>{}, {0}, {3, 4}, {0, 7}, {1, 2, 3, 4, 5, 6}}) {
    const EvictedPrior evicted = PriorOfEvicted(rig_, truth_, Remembered(set));
    EXPECT_GE(InPriorUnits(evicted.prior.information, true), -1e-6);
    EXPECT_GT(InPriorUnits(evicted.prior.information, false), 1e3);
  }
}

TEST_F(EvictedPriorTest, CountsForLessFromFarAndNothingFromTooFar) {
  const Eigen::VectorXd reference = ReferenceSigmas(rig_);
  const Calibration near = BoxPlus(truth_, 1.0 * reference);
  const Calibration far = BoxPlus(truth_, 2.1 * reference);
  SummariseAt(truth_);
  const double here = InPriorUnits(
      PriorOfEvicted(rig_, truth_, Remembered(kept_)).prior.information, false);
  const EvictedPrior from_near = PriorOfEvicted(rig_, near, Remembered(kept_));
  EXPECT_NEAR(from_near.reach, 1, 0.05);
  EXPECT_LT(InPriorUnits(from_near.prior.information, false), here);
  const EvictedPrior from_far = PriorOfEvicted(rig_, far, Remembered(kept_));
  EXPECT_EQ(from_far.segments, 0);
  EXPECT_EQ(from_far.left_out, 5);
}

TEST_F(EvictedPriorTest, CountsForLessWithMoreNoiseAndWithAge) {
  SummariseAt(truth_);
  const auto most = [&](const EvictedPriorOptions& options) {
    return InPriorUnits(PriorOfEvicted(rig_, truth_, Remembered(kept_), options)
                            .prior.information,
                        false);
  };
  const double plain = most({});
  EXPECT_LT(most({.noise_factor = 2}), 0.4 * plain);
  // In the 8 s from the middle of the session it walks a reference sigma.
  EvictedPriorOptions ageing;
  ageing.walk = ReferenceSigmas(rig_) / std::sqrt(8.0);
  EXPECT_LT(most(ageing), 0.2 * plain);
}

// Of a segment of other data under the same key.
TEST_F(EvictedPriorTest, CountsForLessWhereASegmentFitsBadly) {
  SummariseAt(truth_);
  std::vector<RememberedSegment> all = Remembered(kept_);
  const EvictedPrior plain = PriorOfEvicted(rig_, truth_, all);
  SegmentEnds wrong = ends_[3];
  wrong.eta.head(TangentSize(truth_)) +=
      wrong.Lambda.topLeftCorner(27, 27) * ReferenceSigmas(rig_);
  all[3].ends = &wrong;
  const auto moved = [&](double fit) {
    all[3].fit = fit;
    const EvictedPrior evicted = PriorOfEvicted(rig_, truth_, all);
    return BoxMinus(evicted.prior.centre, plain.prior.centre)
        .cwiseQuotient(ReferenceSigmas(rig_))
        .norm();
  };
  EXPECT_LT(moved(5), 0.25 * moved(1));
  EXPECT_EQ(moved(0), moved(1));
}

TEST(ReachWeight, GivesSegmentsThatErrTogetherABoundedSum) {
  EXPECT_EQ(ReachWeight(1, 0), 1);
  EXPECT_EQ(ReachWeight(1000, 0), 1);
  for (const double reach : {0.3, 1.0, 1.7}) {
    double sum = 0;
    for (int k = 1; k <= 400; ++k) sum += ReachWeight(k, reach);
    // As the covariance of the sum is said to grow.
    const double loss = 1 + 0.015 * 400 * std::pow(reach, 4);
    EXPECT_NEAR(sum, 400 / loss, 1.0);
  }
}

}  // namespace
}  // namespace selfcal
