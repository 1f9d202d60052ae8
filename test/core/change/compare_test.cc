#include "core/change/compare.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/change/chi_square.h"
#include "test/core/change/random_information.h"

namespace selfcal {
namespace {

// Estimates from segments of one device, in the linear world of
// RandomInformation: each is the sum of its segments and a weak prior.
class CompareTest : public ::testing::Test {
 protected:
  static constexpr int kSegments = 8;

  void Draw() {
    segments_.clear();
    for (int k = 0; k < kSegments; ++k) {
      segments_.push_back(random_.Segment(rig_, rig_.factory, none_));
    }
  }

  KnownCalibration Estimate(int first, int last) const {
    const std::vector<int> free = FreeComponents(rig_);
    Eigen::MatrixXd Lambda = Eigen::MatrixXd::Zero(size_, size_);
    Eigen::VectorXd eta = Eigen::VectorXd::Zero(size_);
    for (int k = first; k < last; ++k) {
      Lambda += segments_[k].Lambda;
      eta += segments_[k].eta;
    }
    const Eigen::MatrixXd Sigma = Lambda(free, free).inverse();
    KnownCalibration known{rig_.factory, Eigen::MatrixXd::Zero(size_, size_)};
    known.covariance(free, free) = Sigma;
    Eigen::VectorXd delta = Eigen::VectorXd::Zero(size_);
    delta(free) = Sigma * eta(free);
    known.theta = BoxPlus(rig_.factory, delta);
    return known;
  }

  std::vector<SegmentInformation> Shared(int first, int last) const {
    return {segments_.begin() + first, segments_.begin() + last};
  }

  const Rig rig_ = HandheldRig("a");
  const Eigen::Index size_ = TangentSize(rig_.factory);
  const Eigen::VectorXd none_ = Eigen::VectorXd::Zero(size_);
  RandomInformation random_{5};
  std::vector<SegmentInformation> segments_;
};

TEST_F(CompareTest, SigmasAddIfNothingIsShared) {
  Draw();
  const KnownCalibration a = Estimate(0, 4);
  const KnownCalibration b = Estimate(4, 8);
  const CalibrationDifference compared = CompareCalibrations(rig_, a, b, {});
  for (const int i : FreeComponents(rig_)) {
    EXPECT_NEAR(compared.sigmas[i],
                std::sqrt(a.covariance(i, i) + b.covariance(i, i)),
                1e-6 * compared.sigmas[i]);
  }
  EXPECT_EQ(compared.difference, BoxMinus(b.theta, a.theta));
}

TEST_F(CompareTest, VarianceIsTheDifferenceIfOneHasAllOfTheOther) {
  Draw();
  const KnownCalibration a = Estimate(0, 4);
  const KnownCalibration b = Estimate(0, 8);
  const CalibrationDifference compared =
      CompareCalibrations(rig_, a, b, Shared(0, 4));
  for (const int i : FreeComponents(rig_)) {
    const double expected = std::sqrt(a.covariance(i, i) - b.covariance(i, i));
    EXPECT_NEAR(compared.sigmas[i], expected, 1e-4 * expected);
  }
}

// Over many devices: the statistic has the mean and variance of a chi-square,
// for all, some and no shared segments.
TEST_F(CompareTest, StatisticIsChiSquareDistributed) {
  constexpr int kTrials = 400;
  for (const int first_of_b : {0, 2, 4}) {
    double sum = 0;
    int degrees = 0;
    int significant = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      Draw();
      const ConsistencyTest test = CompareCalibrations(rig_,
                                                       Estimate(0, 4),
                                                       Estimate(first_of_b, 8),
                                                       Shared(first_of_b, 4))
                                       .test;
      sum += test.statistic;
      degrees = test.degrees;
      significant += test.probability < 0.01 ? 1 : 0;
    }
    EXPECT_EQ(degrees, static_cast<int>(FreeComponents(rig_).size()));
    const double sigma = std::sqrt(2.0 * degrees / kTrials);
    EXPECT_NEAR(sum / kTrials, degrees, 5 * sigma) << first_of_b;
    EXPECT_LE(significant, 14) << first_of_b;  // 4 are expected
  }
}

TEST_F(CompareTest, AChangedDeviceIsSignificant) {
  Draw();
  const KnownCalibration a = Estimate(0, 4);
  KnownCalibration b = Estimate(4, 8);
  b.theta = BoxPlus(b.theta, 3 * ReferenceSigmas(rig_));
  EXPECT_LT(CompareCalibrations(rig_, a, b, {}).test.probability, 1e-6);
}

TEST_F(CompareTest, AVersionDoesNotDifferFromItself) {
  Draw();
  const KnownCalibration a = Estimate(0, 8);
  const CalibrationDifference compared =
      CompareCalibrations(rig_, a, a, Shared(0, 8));
  // With fused multiply-add, as on arm64, a rotation times its inverse is the
  // identity only to rounding: 6e-25.
  EXPECT_LT(compared.test.statistic, 1e-20);
  EXPECT_EQ(compared.test.probability, 1);
  EXPECT_TRUE(compared.sigmas.allFinite());
}

TEST_F(CompareTest, TooMuchSharedInformationGivesNoNegativeVariance) {
  Draw();
  const CalibrationDifference compared =
      CompareCalibrations(rig_, Estimate(0, 4), Estimate(2, 6), Shared(0, 8));
  EXPECT_TRUE(compared.sigmas.allFinite());
  EXPECT_GE(compared.test.statistic, 0);
  EXPECT_TRUE(std::isfinite(compared.test.statistic));
}

}  // namespace
}  // namespace selfcal
