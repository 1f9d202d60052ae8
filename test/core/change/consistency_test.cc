#include "core/change/consistency.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "test/core/change/random_information.h"

namespace selfcal {
namespace {

class ConsistencyTesterTest : public ::testing::Test {
 protected:
  int Component(const std::string& name) const {
    return MatchComponents(TangentComponents(rig_.factory), {name}).at(0);
  }

  const Rig rig_ = HandheldRig("a");
  const Eigen::VectorXd reference_ = ReferenceSigmas(rig_);
  const Eigen::VectorXd zero_ = Eigen::VectorXd::Zero(reference_.size());
  RandomInformation random_{7};
  // Uncertainty of two reference segments.
  const KnownCalibration active_ = FactoryKnownTo(rig_, 0.5);
  const ConsistencyTester tester_{rig_, active_};
};

TEST_F(ConsistencyTesterTest, IsChiSquareDistributedWithoutAChange) {
  constexpr int kTrials = 4000;
  double sum = 0;
  int degrees = 0;
  int rare = 0;
  std::vector<int> rare_groups(rig_.groups.size());
  for (int i = 0; i < kTrials; ++i) {
    // The error of the active calibration has its covariance.
    const Eigen::VectorXd error = random_.Noise(active_.covariance);
    const auto offset =
        tester_.Offset(random_.Segment(rig_, rig_.factory, error, 0.5));
    const ConsistencyTest test = tester_.Test(offset);
    sum += test.statistic;
    degrees += test.degrees;
    rare += test.probability < 0.01;
    const auto groups = tester_.TestGroups(offset);
    for (std::size_t q = 0; q < groups.size(); ++q) {
      rare_groups[q] += groups[q].test.probability < 0.01;
    }
  }
  // Four standard deviations.
  EXPECT_NEAR(sum, degrees, 4 * std::sqrt(2.0 * degrees));
  const double four = 4 * std::sqrt(kTrials * 0.01 * 0.99);
  EXPECT_NEAR(rare, 0.01 * kTrials, four);
  for (std::size_t q = 0; q < rare_groups.size(); ++q) {
    EXPECT_NEAR(rare_groups[q], 0.01 * kTrials, four) << rig_.groups[q].name;
  }
}

TEST_F(ConsistencyTesterTest, FindsAChangeInItsGroupAlone) {
  Eigen::VectorXd change = zero_;
  change(Component("cam0.q_CI.y")) = 15 * reference_(Component("cam0.q_CI.y"));
  const auto offset =
      tester_.Offset(random_.Segment(rig_, rig_.factory, change, 2));
  EXPECT_LT(tester_.Test(offset).probability, 1e-9);
  for (const GroupConsistency& group : tester_.TestGroups(offset)) {
    if (group.group == "extrinsics") {
      EXPECT_LT(group.test.probability, 1e-9);
    } else {
      EXPECT_GT(group.test.probability, 1e-3) << group.group;
    }
  }
}

TEST_F(ConsistencyTesterTest, DoesNotLookAtWhatASegmentDoesNotObserve) {
  const int blind = Component("imu.gyro.scale.z");
  SegmentInformation information =
      random_.Segment(rig_, rig_.factory, zero_, 1);
  information.Lambda.row(blind).setZero();
  information.Lambda.col(blind).setZero();
  information.eta(blind) = 0;
  const ConsistencyTest before = tester_.Test(tester_.Offset(information));
  EXPECT_EQ(before.degrees, static_cast<int>(FreeComponents(rig_).size()) - 1);
  // A rounding error that would be worth ten prior sigmas if trusted.
  information.Lambda(blind, blind) =
      1e-6 / std::pow(PriorSigmas(rig_)(blind), 2);
  information.eta(blind) = 1e-5 / PriorSigmas(rig_)(blind);
  const ConsistencyTest after = tester_.Test(tester_.Offset(information));
  EXPECT_EQ(after.degrees, before.degrees);
  EXPECT_NEAR(after.statistic, before.statistic, 1e-9 * before.statistic);
}

TEST_F(ConsistencyTesterTest, TestsNothingWhereNothingIsObserved) {
  SegmentInformation information;
  information.theta0 = rig_.factory;
  information.Lambda = Eigen::MatrixXd::Zero(zero_.size(), zero_.size());
  information.eta = zero_;
  const auto offset = tester_.Offset(information);
  EXPECT_EQ(tester_.Test(offset).degrees, 0);
  EXPECT_EQ(tester_.Test(offset).probability, 1);
  for (const GroupConsistency& group : tester_.TestGroups(offset)) {
    EXPECT_EQ(group.test.probability, 1) << group.group;
  }
}

TEST_F(ConsistencyTesterTest, TakesASegmentToTheActiveCalibration) {
  const Eigen::VectorXd truth = random_.Direction(rig_);
  const SegmentInformation here = random_.Segment(rig_, rig_.factory, truth);
  SegmentInformation there = here;
  const Eigen::VectorXd moved = 0.1 * random_.Direction(rig_);
  there.theta0 = BoxPlus(rig_.factory, moved);
  there.eta -= there.Lambda * moved;
  const OffsetInformation offset = tester_.Offset(here);
  const OffsetInformation taken = tester_.Offset(there);
  EXPECT_LT((taken.Lambda - offset.Lambda).norm(), 1e-9 * offset.Lambda.norm());
  EXPECT_LT((taken.eta - offset.eta).norm(), 1e-6 * offset.eta.norm());
  EXPECT_EQ(offset.reach.size(), 0);
  EXPECT_EQ(taken.reach.size(), offset.eta.size());
}

// Noise in the states of the SLAM system that looks like motion: the segment
// claims that theta is its linearisation point, wherever that is.
TEST_F(ConsistencyTesterTest, DoesNotTreatTheLinearisationPointAsEvidence) {
  const ConsistencyTester exact(rig_, FactoryKnownTo(rig_, 1e-4));
  const Eigen::VectorXd moved = 0.9 * random_.Direction(rig_);
  SegmentInformation claims =
      random_.Segment(rig_, BoxPlus(rig_.factory, moved), zero_, 1e4);
  ASSERT_TRUE(exact.Accepts(claims));
  EXPECT_GT(exact.Test(exact.Offset(claims)).probability, 0.01);
  // The same information of a segment that was linearised here is a change.
  claims.theta0 = rig_.factory;
  claims.eta += claims.Lambda * moved;
  EXPECT_LT(exact.Test(exact.Offset(claims)).probability, 1e-9);
}

// The covariance of a calibration is that with the estimated noise: only the
// information of segments is reduced.
TEST_F(ConsistencyTesterTest, TreatsSegmentsAsNoisyAsTheCalibrationFound) {
  KnownCalibration noisy = FactoryKnownTo(rig_, 0);
  const ConsistencyTester exact(rig_, noisy);
  noisy.track_noise_factor = 2;
  const ConsistencyTester careful(rig_, noisy);
  EXPECT_EQ(careful.inflation(), 4);
  const SegmentInformation information =
      random_.Segment(rig_, rig_.factory, random_.Direction(rig_), 1);
  const ConsistencyTest plain = exact.Test(exact.Offset(information));
  const ConsistencyTest inflated = careful.Test(careful.Offset(information));
  ASSERT_EQ(plain.degrees, inflated.degrees);
  EXPECT_NEAR(inflated.statistic, plain.statistic / 4, 1e-9 * plain.statistic);
}

TEST_F(ConsistencyTesterTest, DoesNotInflateTheCalibration) {
  // With a segment without uncertainty, only that of the calibration remains.
  const ConsistencyTester careful(rig_, active_, 4);
  const SegmentInformation information =
      random_.Segment(rig_, rig_.factory, random_.Direction(rig_), 1e6);
  const ConsistencyTest plain = tester_.Test(tester_.Offset(information));
  const ConsistencyTest inflated = careful.Test(careful.Offset(information));
  EXPECT_NEAR(inflated.statistic, plain.statistic, 1e-3 * plain.statistic);
}

TEST_F(ConsistencyTesterTest, IsChiSquareDistributedWithSegmentsThatNoisy) {
  KnownCalibration noisy = active_;
  noisy.track_noise_factor = 2;
  const ConsistencyTester tester(rig_, noisy);
  double sum = 0;
  int degrees = 0;
  for (int i = 0; i < 2000; ++i) {
    // Segments claim four times the information that they have.
    const Eigen::VectorXd error = random_.Noise(noisy.covariance);
    SegmentInformation information =
        random_.Segment(rig_, rig_.factory, error, 0.5);
    information.Lambda *= 4;
    information.eta *= 4;
    const ConsistencyTest test = tester.Test(tester.Offset(information));
    sum += test.statistic;
    degrees += test.degrees;
  }
  EXPECT_NEAR(sum, degrees, 4 * std::sqrt(2.0 * degrees));
}

TEST_F(ConsistencyTesterTest, IgnoresComponentsThatTheRigHoldsFixed) {
  Rig rig = rig_;
  rig.fixed = {"cam0.*"};
  const ConsistencyTester tester(rig, active_);
  SegmentInformation information =
      random_.Segment(rig_, rig_.factory, zero_, 1);
  information.eta.tail(zero_.size() - kImuTangentSize).setConstant(1e9);
  const ConsistencyTest test = tester.Test(tester.Offset(information));
  EXPECT_EQ(test.degrees, kImuTangentSize);
  EXPECT_LT(test.statistic, 100);
}

TEST_F(ConsistencyTesterTest, RejectsSegmentsThatItCannotTest) {
  const SegmentInformation good = random_.Segment(rig_, rig_.factory, zero_);
  EXPECT_TRUE(tester_.Accepts(good));

  SegmentInformation outliers = good;
  outliers.residuals.many_outliers = true;
  EXPECT_FALSE(tester_.Accepts(outliers));

  SegmentInformation broken = good;
  broken.eta(3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(tester_.Accepts(broken));

  SegmentInformation small = good;
  small.Lambda.conservativeResize(15, 15);
  EXPECT_FALSE(tester_.Accepts(small));

  SegmentInformation other = good;
  other.theta0.cameras.push_back(other.theta0.cameras.front());
  EXPECT_FALSE(tester_.Accepts(other));

  SegmentInformation far = good;
  Eigen::VectorXd moved = zero_;
  const int focal = Component("cam0.focal.x");
  moved(focal) = 1.01 * kMaxLinearisation * reference_(focal);
  far.theta0 = BoxPlus(rig_.factory, moved);
  EXPECT_FALSE(tester_.Accepts(far));
}

}  // namespace
}  // namespace selfcal
