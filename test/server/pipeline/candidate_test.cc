#include "server/pipeline/candidate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "test/core/change/random_information.h"
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

  Judgement Judge() {
    return JudgeCandidate(rig_, active_, result_, held_out_);
  }
  std::vector<std::string> Problems() { return Judge().reasons; }
  ValidationCheck Check(const std::string& name) {
    for (const ValidationCheck& check : Judge().validation.checks) {
      if (check.name == name) return check;
    }
    ADD_FAILURE() << "no check " << name;
    return {};
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
  std::vector<SegmentInformation> held_out_;
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

TEST_F(CandidateTest, FiguresAreKeptWithTheirLimits) {
  result_.covariance(5, 5) = active_.covariance(5, 5) * 4;
  result_.status = CalibrateStatus::kNotConverged;
  const ValidationCheck growth = Check("sigma_growth");
  EXPECT_NEAR(growth.value, 2, 1e-9);
  EXPECT_EQ(growth.limit, 1.5);
  EXPECT_FALSE(growth.passed);
  EXPECT_FALSE(Check("converged").passed);
  EXPECT_TRUE(Check("usable").passed);
  EXPECT_NEAR(Check("prior_sigmas").value, 0.5, 1e-9);
  EXPECT_EQ(Judge().validation.active_version, 4);
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

// Of devices whose segments are as good as a reference segment each.
class HeldOutTestOfCandidates : public CandidateTest {
 protected:
  HeldOutTestOfCandidates() {
    const KnownCalibration known = FactoryKnownTo(rig_, 0.04);
    active_.theta = known.theta;
    active_.covariance = known.covariance;
    result_.theta = known.theta;
    result_.covariance = known.covariance;
    result_.track_noise_factor = 1;
  }

  // Segments of a device that is off from the factory's by `offset`.
  void HoldOut(int count, const Eigen::VectorXd& offset) {
    for (int k = 0; k < count; ++k) {
      held_out_.push_back(random_.Segment(rig_, rig_.factory, offset));
    }
  }

  RandomInformation random_{3};
  const Eigen::VectorXd none_ =
      Eigen::VectorXd::Zero(TangentSize(rig_.factory));
  const Eigen::VectorXd off_ = 1.9 * ReferenceSigmas(rig_);
};

TEST_F(HeldOutTestOfCandidates, AGoodOnePasses) {
  for (int trial = 0; trial < 100; ++trial) {
    held_out_.clear();
    HoldOut(8, none_);
    ASSERT_THAT(Problems(), IsEmpty()) << trial;
  }
  const HeldOutTest test = Judge().validation.held_out;
  EXPECT_EQ(test.segments, 7);
  EXPECT_EQ(test.left_out, 1);
  EXPECT_GT(test.candidate.degrees, 20);
  EXPECT_EQ(test.active.statistic, test.candidate.statistic);
}

TEST_F(HeldOutTestOfCandidates, OneFromCorruptedSegmentsIsRejectedForThat) {
  result_.theta = BoxPlus(rig_.factory, off_);
  HoldOut(8, none_);
  EXPECT_THAT(Problem(), HasSubstr("held-out"));
  EXPECT_FALSE(Check("held_out_probability").passed);
  EXPECT_LT(Check("held_out_probability").value, 1e-4);
  const HeldOutTest test = Judge().validation.held_out;
  EXPECT_GT(test.candidate.statistic, 3 * test.active.statistic);
}

TEST_F(HeldOutTestOfCandidates, OneThatFollowsTheDevicePasses) {
  result_.theta = BoxPlus(rig_.factory, off_);
  HoldOut(8, off_);
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_LT(Judge().validation.held_out.active.probability, 1e-4);
}

TEST_F(HeldOutTestOfCandidates, OneBadSegmentProvesNothing) {
  HoldOut(5, none_);
  HoldOut(1, off_);
  EXPECT_THAT(Problems(), IsEmpty());
  HoldOut(5, off_);
  EXPECT_THAT(Judge().validation.checks.back().value, ::testing::Lt(1e-4));
}

TEST_F(HeldOutTestOfCandidates, WhatCannotBeTestedIsCounted) {
  HoldOut(3, none_);
  result_.theta = BoxPlus(rig_.factory, 3 * ReferenceSigmas(rig_));
  EXPECT_THAT(Problems(), IsEmpty());
  const HeldOutTest test = Judge().validation.held_out;
  EXPECT_EQ(test.segments, 0);
  EXPECT_EQ(test.left_out, 3);
  EXPECT_EQ(test.candidate.degrees, 0);
}

}  // namespace
}  // namespace selfcal::server
