#include "server/pipeline/candidate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "test/server/test_segments.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class CandidateTest : public ::testing::Test {
 protected:
  CandidateTest() {
    const Eigen::VectorXd prior = PriorSigmas(rig_);
    active_.version = 4;
    active_.theta = rig_.factory;
    active_.covariance = (0.01 * prior).cwiseAbs2().asDiagonal();
    result_.status = CalibrateStatus::kConverged;
    result_.theta = BoxPlus(rig_.factory, 0.5 * prior);
    result_.covariance = active_.covariance;
  }

  std::vector<std::string> Problems() {
    return CandidateProblems(rig_, active_, result_);
  }
  // The one problem of this result, or all of them.
  std::string Problem() {
    const auto problems = Problems();
    EXPECT_EQ(problems.size(), 1u) << ::testing::PrintToString(problems);
    return problems.empty() ? std::string() : problems.front();
  }

  Rig rig_ = TestRig("a");
  StoredCalibration active_;
  CalibrationResult result_;
};

TEST_F(CandidateTest, SoundOneHasNoProblem) {
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(CandidateTest, SolverMustHaveConverged) {
  result_.status = CalibrateStatus::kNotConverged;
  result_.iterations = 77;
  EXPECT_THAT(Problem(), HasSubstr("77"));
}

TEST_F(CandidateTest, NumbersMustBeFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  result_.theta.imu.s_g.x() = nan;
  EXPECT_THAT(Problem(), HasSubstr("finite"));
  result_.theta = rig_.factory;
  result_.covariance(2, 3) = nan;
  EXPECT_THAT(Problem(), HasSubstr("finite"));
}

TEST_F(CandidateTest, VariancesMustNotBeNegative) {
  result_.covariance(2, 2) = -1e-12;
  EXPECT_THAT(Problem(), HasSubstr("negative"));
}

TEST_F(CandidateTest, ShapeMustBeThatOfTheRig) {
  result_.covariance = Eigen::MatrixXd::Identity(3, 3);
  EXPECT_THAT(Problem(), HasSubstr("shape"));
  result_.theta.cameras.clear();
  EXPECT_THAT(Problem(), HasSubstr("shape"));
}

TEST_F(CandidateTest, ValuesMustLieWithinTenPriorSigmasOfTheFactory) {
  const auto components = TangentComponents(rig_.factory);
  const Eigen::VectorXd prior = PriorSigmas(rig_);
  // The focal length: ten prior sigmas of it are still a camera.
  const int k = kImuTangentSize + kCameraIntrinsics;
  Eigen::VectorXd delta = Eigen::VectorXd::Zero(prior.size());
  delta[k] = 9.99 * prior[k];
  result_.theta = BoxPlus(rig_.factory, delta);
  EXPECT_THAT(Problems(), IsEmpty());
  delta[k] = 10.01 * prior[k];
  result_.theta = BoxPlus(rig_.factory, delta);
  EXPECT_THAT(Problem(), HasSubstr(components[k].name));
}

TEST_F(CandidateTest, ValuesMustBeThoseOfACalibration) {
  rig_.prior_sigmas = {{"*", 1e6}};
  result_.theta.cameras[0].f.x() = -5;
  EXPECT_THAT(Problems(), ::testing::Not(IsEmpty()));
}

TEST_F(CandidateTest, SigmaMayNotGrowByMoreThanHalf) {
  result_.covariance(5, 5) = active_.covariance(5, 5) * 1.49 * 1.49;
  EXPECT_THAT(Problems(), IsEmpty());
  result_.covariance(5, 5) = active_.covariance(5, 5) * 1.51 * 1.51;
  EXPECT_THAT(Problem(), HasSubstr(TangentComponents(rig_.factory)[5].name));
}

TEST_F(CandidateTest, SigmaIsNotComparedWhereOneOfThemObservedNothing) {
  const double prior = PriorSigmas(rig_)[5];
  result_.covariance(5, 5) = prior * prior;
  EXPECT_THAT(Problems(), IsEmpty());
  // The factory's version observes nothing.
  active_.covariance = PriorSigmas(rig_).cwiseAbs2().asDiagonal();
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(CandidateTest, FixedComponentsAreNotLookedAt) {
  rig_.fixed = {"imu.accel.scale.*"};
  result_.covariance(6, 6) = 0;
  active_.covariance(6, 6) = 0;
  EXPECT_THAT(Problems(), IsEmpty());
}

}  // namespace
}  // namespace selfcal::server
