#include "core/coach/predict.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/information/segment_information.h"
#include "core/model/symmetric_eigen.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

// Gain of a segment's information with the prior [nat].
double GainOf(const Rig& rig, const Eigen::MatrixXd& Lambda) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig)(free);
  const Eigen::MatrixXd normalised =
      prior.asDiagonal() * Lambda(free, free) * prior.asDiagonal();
  const Eigen::VectorXd eigenvalues = SymmetricEigenvalues(normalised);
  return 0.5 * eigenvalues.cwiseMax(0).array().log1p().sum();
}

TEST(Predict, HasInformationForEveryMotion) {
  const Rig rig = StereoRig();
  const Predictions predictions = Predict(rig, rig.factory);
  EXPECT_EQ(predictions.segment_s, 4);
  ASSERT_EQ(predictions.motions.size(), Primitives().size());
  for (std::size_t i = 0; i < predictions.motions.size(); ++i) {
    const MotionPrediction& motion = predictions.motions[i];
    EXPECT_EQ(motion.motion, Primitives()[i].name);
    EXPECT_EQ(motion.instruction, Primitives()[i].instruction);
    ASSERT_EQ(motion.Lambda.rows(), TangentSize(rig.factory));
    EXPECT_TRUE(motion.Lambda.allFinite());
    EXPECT_LT((motion.Lambda - motion.Lambda.transpose()).norm(),
              1e-9 * motion.Lambda.norm());
    EXPECT_GT(GainOf(rig, motion.Lambda), 0);
  }
}

// Ten degrees above the reference temperature, slopes show as well.
TEST(Predict, HasInformationAboutEveryBlockThatThereIs) {
  Rig rig = HandheldRig("r");
  EstimateEveryBlock(&rig);
  PredictOptions options;
  options.simulation.temperature_c = rig.factory.reference_temperature_c + 10;
  const auto components = TangentComponents(rig.factory);
  const auto size = static_cast<Eigen::Index>(components.size());
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const Predictions predictions = Predict(rig, rig.factory, options);
  ASSERT_EQ(predictions.motions.size(), Primitives().size());
  for (const MotionPrediction& motion : predictions.motions) {
    SCOPED_TRACE(motion.motion);
    ASSERT_EQ(motion.Lambda.rows(), size);
    ASSERT_EQ(motion.Lambda.cols(), size);
    ASSERT_TRUE(motion.Lambda.allFinite());
    const Eigen::VectorXd eigenvalues = SymmetricEigenvalues(
        prior.asDiagonal() * motion.Lambda * prior.asDiagonal());
    // Semidefinite but for rounding of the largest.
    EXPECT_GT(eigenvalues.minCoeff(), -1e-12 * eigenvalues.maxCoeff());
    for (Eigen::Index i = 0; i < size; ++i) {
      EXPECT_GT(motion.Lambda(i, i), 0) << components[i].name;
    }
  }
}

TEST(Predict, HasNoInformationAboutFixedComponents) {
  Rig rig = HandheldRig("r");
  rig.fixed = {"imu.gyro.*"};
  const Predictions predictions = Predict(rig, rig.factory);
  ASSERT_FALSE(predictions.motions.empty());
  for (const MotionPrediction& motion : predictions.motions) {
    EXPECT_EQ(motion.Lambda.topRows(kAccelScale).norm(), 0);
  }
}

TEST(Predict, GivesTheSameBitsAgain) {
  const Rig rig = HandheldRig("r");
  const Predictions a = Predict(rig, rig.factory);
  const Predictions b = Predict(rig, rig.factory);
  for (std::size_t i = 0; i < a.motions.size(); ++i) {
    EXPECT_EQ(a.motions[i].Lambda, b.motions[i].Lambda);
  }
}

TEST(Predict, AllowsADelayOfTheImages) {
  Rig rig = HandheldRig("r");
  rig.blocks = {{"*.time_offset", true}};
  for (const double delay_s : {-0.3, 0.3}) {
    rig.factory.cameras[0].time_offset_s = delay_s;
    const Predictions predictions = Predict(rig, rig.factory);
    ASSERT_FALSE(predictions.motions.empty());
    for (const MotionPrediction& motion : predictions.motions) {
      EXPECT_TRUE(motion.Lambda.allFinite());
    }
  }
}

TEST(Predict, AllowsATimeOffsetOfASecondImu) {
  Rig rig = HandheldRig("r");
  AddSecondImu(&rig);
  rig.blocks = {{"*.time_offset", true}};
  for (const double offset_s : {-kMaxSecondOffset_s, kMaxSecondOffset_s}) {
    rig.factory.imu1->time_offset_s = offset_s;
    const Predictions predictions = Predict(rig, rig.factory);
    ASSERT_FALSE(predictions.motions.empty());
    for (const MotionPrediction& motion : predictions.motions) {
      EXPECT_TRUE(motion.Lambda.allFinite());
    }
  }
}

// A motion is predicted with a calibration as inaccurate as a factory
// calibration. Its predicted value is that of real segments: the remaining
// sigmas are right within a few tens of percent, on average over the directions
// of theta.
TEST(Predict, ComesCloseToSegmentsOfTheSameMotion) {
  for (const std::uint64_t seed : {1, 2}) {
    Rig rig = HandheldRig("r");
    const Calibration truth = rig.factory;
    rig.factory = PerturbCalibration(truth, {}, seed);
    const Predictions predictions = Predict(rig, rig.factory);
    const auto size = static_cast<double>(FreeComponents(rig).size());
    for (std::size_t i = 0; i < Primitives().size(); ++i) {
      SimulationOptions options;
      options.seed = 100 + seed;
      const MotionSegment segment =
          SimulatePrimitive(rig, truth, rig.factory, Primitives()[i], options);
      const double actual =
          GainOf(rig, ScoreSegment(rig, rig.factory, segment).Lambda);
      const double predicted = GainOf(rig, predictions.motions[i].Lambda);
      const double sigma_ratio = std::exp((predicted - actual) / size);
      EXPECT_GT(sigma_ratio, 0.7) << Primitives()[i].name;
      EXPECT_LT(sigma_ratio, 1.45) << Primitives()[i].name;
    }
  }
}

}  // namespace
}  // namespace selfcal
