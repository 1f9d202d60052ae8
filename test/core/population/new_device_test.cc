#include "core/population/new_device.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/information/fusion.h"
#include "core/population/consistency.h"
#include "core/simulation/simulate.h"
#include "test/core/population/run_estimate.h"

namespace selfcal {
namespace {

class NewDevice : public testing::Test {
 protected:
  // A cohort of devices that differ by a tenth of the tolerances.
  NewDevice() : rig_(HandheldRig("device")), sigmas_(PriorSigmas(rig_)) {
    const auto size = sigmas_.size();
    cohort_.reference = rig_.factory;
    cohort_.scale = sigmas_;
    cohort_.mu = Eigen::VectorXd::Zero(size);
    for (const int k : FreeComponents(rig_)) {
      cohort_.mu(k) = 0.5 * sigmas_(k) * Normal();
    }
    cohort_.S = (0.1 * sigmas_).cwiseAbs2().asDiagonal();
    cohort_.mu_covariance = 0.01 * cohort_.S;
    cohort_.degrees = Eigen::VectorXd::Constant(size, 1e6);
  }

  double Normal() { return std::normal_distribution()(random_); }

  // Information of a segment that was scored at the factory calibration and
  // observes `rows` directions of the free components.
  SegmentInformation Segment(int rows) {
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(rows, sigmas_.size());
    Eigen::VectorXd noise(rows);
    for (int i = 0; i < rows; ++i) {
      for (const int k : FreeComponents(rig_)) {
        J(i, k) = 20 * Normal() / sigmas_(k);
      }
      noise(i) = Normal();
    }
    SegmentInformation segment;
    segment.theta0 = rig_.factory;
    segment.Lambda = J.transpose() * J;
    segment.eta = J.transpose() * noise;
    return segment;
  }

  Rig rig_;
  Eigen::VectorXd sigmas_;
  Cohort cohort_;
  std::mt19937 random_{3};
};

TEST_F(NewDevice, HasTheMeanAndTheSpreadOfTheCohort) {
  rig_.prior_mean = rig_.factory;
  rig_.prior_sigmas = {{"*", 1}};
  const Rig described = DescribeNewDevice(rig_, cohort_);
  EXPECT_FALSE(described.prior_mean.has_value());
  EXPECT_LT((BoxMinus(described.factory, rig_.factory) - cohort_.mu)
                .cwiseQuotient(sigmas_)
                .norm(),
            1e-9);
  const Eigen::VectorXd expected = 0.1 * std::sqrt(1.01) * sigmas_;
  EXPECT_TRUE(PriorSigmas(described).isApprox(expected, 1e-4));
}

// An existing rig to which the prior of the cohort is given.
TEST_F(NewDevice, KnowsWhatAnOlderRigWithItsPriorKnows) {
  const Rig described = DescribeNewDevice(rig_, cohort_);
  Rig given = rig_;
  given.prior_mean = described.factory;
  given.prior_sigmas = described.prior_sigmas;
  ASSERT_TRUE(Validate(given).empty());
  const std::vector<SegmentInformation> segments = {Segment(5), Segment(8)};
  const FusedEstimate fused = Fuse(given, segments);
  const FusedEstimate expected = Fuse(described, segments);
  EXPECT_LT(BoxMinus(fused.theta, expected.theta).norm(), 1e-15);
  EXPECT_TRUE(fused.covariance.isApprox(expected.covariance, 1e-12));
  EXPECT_GT(BoxMinus(fused.theta, Fuse(rig_, segments).theta)
                .cwiseQuotient(sigmas_)
                .norm(),
            0.1);
  const RunEstimate run = EstimateAsARun(described, segments[1]);
  const PriorAgreement agreement =
      CompareWithPrior(given, run.theta, run.covariance);
  EXPECT_GT(agreement.degrees, 0);
  EXPECT_EQ(agreement.statistic,
            CompareWithPrior(described, run.theta, run.covariance).statistic);
}

}  // namespace
}  // namespace selfcal
