#include "core/population/prior_start.h"

#include <gtest/gtest.h>

#include <random>

#include "core/information/fusion.h"
#include "core/simulation/simulate.h"
#include "test/core/population/run_estimate.h"

namespace selfcal {
namespace {

// Small enough that the curvature of rotations does not matter.
constexpr double kTiny = 1e-6;

class PriorStart : public testing::Test {
 protected:
  PriorStart() : rig_(HandheldRig("device")), sigmas_(PriorSigmas(rig_)) {
    with_mean_ = rig_;
    with_mean_.prior_mean = Moved(1);
  }

  double Normal() { return std::normal_distribution()(random_); }

  // Moves the factory calibration within what is estimated.
  Calibration Moved(double sigmas) {
    Eigen::VectorXd offset = Eigen::VectorXd::Zero(sigmas_.size());
    for (const int k : FreeComponents(rig_)) {
      offset(k) = kTiny * sigmas * sigmas_(k) * Normal();
    }
    return BoxPlus(rig_.factory, offset);
  }

  // Precise information about `rows` directions.
  SegmentInformation Data(int rows) {
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(rows, sigmas_.size());
    for (int i = 0; i < rows; ++i) {
      for (const int k : FreeComponents(rig_)) {
        J(i, k) = 1e3 * Normal() / sigmas_(k);
      }
    }
    SegmentInformation data;
    data.theta0 = Moved(1);
    data.Lambda = J.transpose() * J;
    data.eta.setZero(sigmas_.size());
    return data;
  }

  // In sigmas of the prior, where the movements are 1.
  double Distance(const Calibration& a, const Calibration& b) const {
    return BoxMinus(a, b).cwiseQuotient(sigmas_).norm() / kTiny;
  }

  Rig rig_;
  Eigen::VectorXd sigmas_;
  Rig with_mean_;
  std::mt19937 random_{4};
};

// The run of a rig that was created with the mean leaves these directions
// there.
TEST_F(PriorStart, WhatARunHeldConstantGetsTheMean) {
  const SegmentInformation data = Data(13);
  const RunEstimate before = EstimateAsARun(rig_, data);
  Rig created = rig_;
  created.factory = *with_mean_.prior_mean;
  const RunEstimate expected = EstimateAsARun(created, data);
  ASSERT_GT(Distance(before.theta, expected.theta), 1);
  const Calibration start =
      StartFromPrior(with_mean_, before.theta, before.covariance);
  EXPECT_LT(Distance(start, expected.theta), 1e-3);
}

TEST_F(PriorStart, WhatARunHasDeterminedRemains) {
  const RunEstimate before = EstimateAsARun(rig_, Data(100));
  const Calibration start =
      StartFromPrior(with_mean_, before.theta, before.covariance);
  EXPECT_LT(Distance(start, before.theta), 1e-3);
  EXPECT_GT(Distance(start, *with_mean_.prior_mean), 1);
}

TEST_F(PriorStart, IsTheMeanOfANarrowerPriorIfNothingIsKnown) {
  SegmentInformation nothing = Data(1);
  nothing.Lambda.setZero();
  const RunEstimate before = EstimateAsARun(rig_, nothing);
  for (const TangentComponent& component : TangentComponents(rig_.factory)) {
    with_mean_.prior_sigmas.push_back({component.name, component.sigma_ref});
  }
  EXPECT_LT(
      Distance(StartFromPrior(with_mean_, before.theta, before.covariance),
               *with_mean_.prior_mean),
      1e-6);
}

}  // namespace
}  // namespace selfcal
