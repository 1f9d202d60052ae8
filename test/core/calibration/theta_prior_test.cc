#include "core/calibration/theta_prior.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "core/calibration/calibrate.h"
#include "core/calibration/subspace.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

std::vector<int> Components(const Rig& rig, const std::string& group) {
  for (const ParameterGroup& settings : rig.groups) {
    if (settings.name == group) return GroupComponents(rig, settings);
  }
  return {};
}

TEST(MarginalPrior, IsTheInverseOfTheMarginalCovariance) {
  Rig rig = HandheldRig("r");
  rig.fixed = {"cam0.focal.x"};
  const int size = TangentSize(rig.factory);
  // Coupled parameters.
  const Eigen::VectorXd sigmas = ReferenceSigmas(rig);
  const Eigen::MatrixXd covariance =
      sigmas.asDiagonal() *
      (Eigen::MatrixXd::Identity(size, size) +
       Eigen::MatrixXd::Constant(size, size, 0.5)) *
      sigmas.asDiagonal();
  std::vector<int> camera =
      MatchComponents(TangentComponents(rig.factory), {"cam0.focal.*"});
  ASSERT_EQ(camera.size(), 2u);
  const ThetaPrior prior = MarginalPrior(rig, rig.factory, covariance, camera);
  // One of the two is fixed: what remains is a single number.
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(size, size);
  expected(camera[1], camera[1]) = 1 / covariance(camera[1], camera[1]);
  EXPECT_LT((prior.information - expected).norm(), 1e-9 * expected.norm());

  const std::vector<int> imu = Components(rig, "imu");
  const ThetaPrior of_imu = MarginalPrior(rig, rig.factory, covariance, imu);
  const Eigen::MatrixXd product =
      of_imu.information(imu, imu) * covariance(imu, imu);
  EXPECT_LT((product - Eigen::MatrixXd::Identity(15, 15)).norm(), 1e-9);
  EXPECT_EQ(of_imu.information(imu[0], camera[1]), 0);
}

// Two sessions of one device, which share nothing but theta.
class CalibrateWithPrior : public ::testing::Test {
 protected:
  CalibrateWithPrior() : truth_(rig_.factory) {
    rig_.factory = PerturbCalibration(truth_, {}, 1);
    for (const std::uint64_t seed : {1, 2}) {
      SimulationOptions options;
      options.seed = seed;
      options.keyframes_per_segment = 20;
      options.landmarks_in_view = 60;
      sessions_.push_back(Simulate(rig_,
                                   truth_,
                                   rig_.factory,
                                   *MakeHandheld(8.5, 1.0, seed),
                                   "session" + std::to_string(seed),
                                   options)
                              .segments);
    }
  }

  const Calibration& start() const { return rig_.factory; }

  Rig rig_ = HandheldRig("r");
  const Calibration truth_;
  std::vector<std::vector<MotionSegment>> sessions_;
};

TEST_F(CalibrateWithPrior, AddsUpToTheCalibrationOnAllSegments) {
  const CalibrationResult first = Calibrate(rig_, start(), sessions_[0]);
  std::vector<int> all = FreeComponents(rig_);
  CalibrateOptions options;
  options.prior = MarginalPrior(rig_, first.theta, first.covariance, all);
  const CalibrationResult fused =
      Calibrate(rig_, first.theta, sessions_[1], options);
  std::vector<MotionSegment> both = sessions_[0];
  both.insert(both.end(), sessions_[1].begin(), sessions_[1].end());
  const CalibrationResult joint = Calibrate(rig_, start(), both);
  for (const CalibrationResult* result : {&first, &fused, &joint}) {
    ASSERT_EQ(result->status, CalibrateStatus::kConverged) << result->message;
  }
  EXPECT_LT(
      LargestInSigmas(BoxMinus(fused.theta, joint.theta), joint.covariance),
      0.3);
  const Eigen::ArrayXd ratio =
      fused.covariance.diagonal().cwiseQuotient(joint.covariance.diagonal());
  EXPECT_LT((ratio.sqrt() - 1).abs().maxCoeff(), 0.05);
}

TEST_F(CalibrateWithPrior, HasNoInformationAboutTheOtherComponents) {
  // A camera that was rotated since the prior, by 60 of its sigmas.
  Calibration before = truth_;
  before.cameras[0].q_CI =
      before.cameras[0].q_CI *
      Eigen::Quaterniond(Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX()));
  const Eigen::MatrixXd covariance =
      (0.05 * ReferenceSigmas(rig_)).cwiseAbs2().asDiagonal();
  std::vector<int> known = Components(rig_, "camera");
  CalibrateOptions options;
  options.prior = MarginalPrior(rig_, before, covariance, known);
  for (const SolverKind solver :
       {SolverKind::kStructured, SolverKind::kCeres}) {
    options.solver = solver;
    const CalibrationResult result =
        Calibrate(rig_, before, sessions_[0], options);
    ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
    const Eigen::VectorXd error = BoxMinus(result.theta, truth_);
    const Eigen::VectorXd sigmas = result.covariance.diagonal().cwiseSqrt();
    EXPECT_LT((error.array() / sigmas.array()).abs().maxCoeff(), 3.5);
    for (const int i : known) {
      EXPECT_LT(sigmas(i), 0.051 * ReferenceSigmas(rig_)(i));
    }
    EXPECT_TRUE(result.held_constant.empty());
  }
}

TEST_F(CalibrateWithPrior, NothingIsHeldUnderTheFactorysPrior) {
  // At rest the segments alone have almost no information.
  SimulationOptions simulation;
  simulation.keyframes_per_segment = 10;
  const auto segments =
      Simulate(rig_, truth_, rig_.factory, *MakeRest(1.5), "rest", simulation)
          .segments;
  CalibrateOptions options;
  EXPECT_GT(Calibrate(rig_, start(), segments, options).held_constant.size(),
            10u);
  options.prior = FactoryPrior(rig_);
  const CalibrationResult result = Calibrate(rig_, start(), segments, options);
  EXPECT_TRUE(result.held_constant.empty());
  EXPECT_EQ(result.rank, static_cast<int>(FreeComponents(rig_).size()));
}

TEST_F(CalibrateWithPrior, APriorOfAnotherShapeIsRejected) {
  CalibrateOptions options;
  options.prior = FactoryPrior(rig_);
  options.prior->information.conservativeResize(15, 15);
  const CalibrationResult result =
      Calibrate(rig_, start(), sessions_[0], options);
  EXPECT_EQ(result.status, CalibrateStatus::kFailed);
  EXPECT_NE(result.message.find("prior"), std::string::npos);
}

}  // namespace
}  // namespace selfcal
