#include "core/calibration/remembered_information.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "core/model/symmetric_eigen.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// A session of eight segments.
class RememberedInformationTest : public ::testing::Test {
 protected:
  RememberedInformationTest() : truth_(rig_.factory) {
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

  std::vector<JoinedSegment> Remembered(
      const std::vector<int>& with_data) const {
    std::vector<JoinedSegment> all;
    for (const SegmentEnds& ends : ends_) {
      all.push_back({.ends = &ends, .time_ns = ends.first.t_ns});
    }
    for (const int i : with_data) all[i].calibrated_on = true;
    return all;
  }

  double InPriorUnits(const Eigen::MatrixXd& information, bool smallest) const {
    const std::vector<int> free = FreeComponents(rig_);
    const Eigen::VectorXd scale = PriorSigmas(rig_)(free);
    const Eigen::VectorXd values = SymmetricEigenvalues(
        scale.asDiagonal() * information(free, free) * scale.asDiagonal());
    return smallest ? values.minCoeff() : values.maxCoeff();
  }

  // The resulting offset from the point, with the rig's prior.
  Eigen::VectorXd Solve(const RememberedInformation& remembered) const {
    Eigen::MatrixXd Lambda = remembered.information.Lambda;
    Lambda.diagonal() += PriorSigmas(rig_).cwiseAbs2().cwiseInverse();
    return Lambda.ldlt().solve(remembered.information.eta);
  }

  const std::vector<int> kept_ = {1, 2, 5};
  Rig rig_ = HandheldRig("r");
  Calibration truth_;
  std::vector<MotionSegment> segments_;
  std::vector<SegmentEnds> ends_;
};

TEST_F(RememberedInformationTest, IsZeroIfAllSegmentsHaveTheirData) {
  SummariseAt(truth_);
  const RememberedInformation remembered = InformationOfRemembered(
      rig_, truth_, Remembered({0, 1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(remembered.segments, 0);
  EXPECT_TRUE(remembered.information.Lambda.isZero());
  EXPECT_TRUE(remembered.information.eta.isZero());
}

// Data never reduces information.
TEST_F(RememberedInformationTest, IsSemidefiniteWhateverHasData) {
  SummariseAt(truth_);
  for (const std::vector<int>& set :
       {std::vector<int>{}, {0}, {3, 4}, {0, 7}, {1, 2, 3, 4, 5, 6}}) {
    const RememberedInformation remembered =
        InformationOfRemembered(rig_, truth_, Remembered(set));
    EXPECT_GE(InPriorUnits(remembered.information.Lambda, true), -1e-6);
    EXPECT_GT(InPriorUnits(remembered.information.Lambda, false), 1e3);
  }
}

TEST_F(RememberedInformationTest, HasLessWeightFromFarAndNoneFromTooFar) {
  const Eigen::VectorXd reference = ReferenceSigmas(rig_);
  const Calibration near = BoxPlus(truth_, 1.0 * reference);
  const Calibration far = BoxPlus(truth_, 2.1 * reference);
  SummariseAt(truth_);
  const double here =
      InPriorUnits(InformationOfRemembered(rig_, truth_, Remembered(kept_))
                       .information.Lambda,
                   false);
  const RememberedInformation from_near =
      InformationOfRemembered(rig_, near, Remembered(kept_));
  EXPECT_NEAR(from_near.reach, 1, 0.05);
  EXPECT_LT(InPriorUnits(from_near.information.Lambda, false), here);
  const RememberedInformation from_far =
      InformationOfRemembered(rig_, far, Remembered(kept_));
  EXPECT_EQ(from_far.segments, 0);
  EXPECT_EQ(from_far.left_out, 5);
}

TEST_F(RememberedInformationTest, HasLessWeightWithMoreNoiseAndWithAge) {
  SummariseAt(truth_);
  const auto most = [&](const RememberedOptions& options) {
    return InPriorUnits(
        InformationOfRemembered(rig_, truth_, Remembered(kept_), options)
            .information.Lambda,
        false);
  };
  const double plain = most({});
  EXPECT_LT(most({.noise_scale = 2}), 0.4 * plain);
  // In the 8 s from the middle of the session theta walks one reference sigma.
  RememberedOptions ageing;
  ageing.walk = ReferenceSigmas(rig_) / std::sqrt(8.0);
  EXPECT_LT(most(ageing), 0.2 * plain);
}

// The key is used for a segment with other data.
TEST_F(RememberedInformationTest, HasLessWeightIfASegmentFitsBadly) {
  SummariseAt(truth_);
  std::vector<JoinedSegment> all = Remembered(kept_);
  const RememberedInformation plain =
      InformationOfRemembered(rig_, truth_, all);
  SegmentEnds wrong = ends_[3];
  wrong.eta.head(TangentSize(truth_)) +=
      wrong.Lambda.topLeftCorner(27, 27) * ReferenceSigmas(rig_);
  all[3].ends = &wrong;
  const auto moved = [&](double fit) {
    all[3].fit = fit;
    return (Solve(InformationOfRemembered(rig_, truth_, all)) - Solve(plain))
        .cwiseQuotient(ReferenceSigmas(rig_))
        .norm();
  };
  EXPECT_LT(moved(5), 0.25 * moved(1));
  EXPECT_EQ(moved(0), moved(1));
}

TEST(ReachWeight, BoundsTheSumOfSegmentsWithACommonError) {
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
