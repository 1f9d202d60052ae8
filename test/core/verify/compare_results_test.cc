#include "core/verify/compare_results.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// A result whose components have the sigmas of the prior times 0.1.
class CompareResultsTest : public testing::Test {
 protected:
  CompareResultsTest() {
    result_.status = CalibrateStatus::kConverged;
    result_.theta = rig_.factory;
    sigmas_ = 0.1 * PriorSigmas(rig_);
    for (int i = 0; i < sigmas_.size(); ++i) {
      if (std::ranges::count(FreeComponents(rig_), i) == 0) sigmas_(i) = 0;
    }
    result_.covariance = sigmas_.cwiseAbs2().asDiagonal();
    result_.rank = static_cast<int>(FreeComponents(rig_).size());
  }

  int Index(const std::string& name) const {
    const auto components = TangentComponents(rig_.factory);
    return static_cast<int>(
        std::ranges::find(components, name, &TangentComponent::name) -
        components.begin());
  }

  const Rig rig_ = HandheldRig("handheld");
  Eigen::VectorXd sigmas_;
  CalibrationResult result_;
};

TEST_F(CompareResultsTest, NamesTheComponentThatDiffersMost) {
  CalibrationResult other = result_;
  Eigen::VectorXd d = Eigen::VectorXd::Zero(sigmas_.size());
  const int focal = Index("cam0.focal.x");
  d(focal) = -0.3 * sigmas_(focal);
  other.theta = BoxPlus(other.theta, d);
  const int gyro = Index("imu.gyro.scale.y");
  other.covariance(gyro, gyro) *= 1.21;
  const ResultDifference difference = CompareResults(rig_, result_, other);
  EXPECT_EQ(difference.incomparable, "");
  EXPECT_NEAR(difference.theta_sigmas, 0.3, 1e-9);
  EXPECT_EQ(difference.theta_component, "cam0.focal.x");
  EXPECT_NEAR(difference.sigma, 0.1, 1e-9);
  EXPECT_EQ(difference.sigma_component, "imu.gyro.scale.y");
  EXPECT_NEAR(difference.covariance, 0.1, 1e-9);
  EXPECT_FALSE(IsConvergence(difference));
}

// Sigmas are the same, but a direction is known four times worse.
TEST_F(CompareResultsTest, DetectsCorrelationsInTheCovariance) {
  const int x = Index("cam0.focal.x");
  const int y = Index("cam0.focal.y");
  const auto correlated = [&](double by) {
    CalibrationResult result = result_;
    result.covariance(x, y) = result.covariance(y, x) =
        by * sigmas_(x) * sigmas_(y);
    return result;
  };
  const ResultDifference difference =
      CompareResults(rig_, correlated(1 - 1.0 / 16), result_);
  EXPECT_LT(difference.sigma, 1e-12);
  EXPECT_NEAR(difference.covariance, 3, 1e-6);
}

TEST_F(CompareResultsTest, DoesNotCompareResultsThatDidNotConvergeOrHoldMore) {
  CalibrationResult other = result_;
  other.rank -= 1;
  EXPECT_NE(CompareResults(rig_, result_, other).incomparable, "");
  other = result_;
  other.segments += 1;
  EXPECT_NE(CompareResults(rig_, result_, other).incomparable, "");
  other = result_;
  other.status = CalibrateStatus::kNotConverged;
  EXPECT_NE(CompareResults(rig_, result_, other).incomparable, "");
  other = result_;
  other.remembered.segments +=
      1;  // on one side alone, what is remembered helps
  EXPECT_NE(CompareResults(rig_, result_, other).incomparable, "");
}

TEST_F(CompareResultsTest, WhatIsNotANumberDiffers) {
  CalibrationResult other = result_;
  other.theta.cameras[0].f.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IsConvergence(CompareResults(rig_, result_, other)));
}

}  // namespace
}  // namespace selfcal
