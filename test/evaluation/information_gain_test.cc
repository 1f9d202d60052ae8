#include "test/evaluation/information_gain.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>

#include "core/information/inliers.h"
#include "core/information/segment_information.h"
#include "core/simulation/simulate.h"
#include "test/reference/segment_jacobian.h"
#include "test/reference/sparse_qr.h"

namespace selfcal {
namespace {

struct Scene {
  Rig rig = HandheldRig("simulated");
  std::vector<MotionSegment> segments;
};

Scene MakeScene(const Trajectory& trajectory, std::uint64_t seed = 1) {
  Scene scene;
  const Calibration truth = scene.rig.factory;
  scene.rig.factory = PerturbCalibration(truth, {}, seed);
  SimulationOptions options;
  options.seed = seed;
  options.revisit_fraction = 0;
  scene.segments =
      Simulate(
          scene.rig, truth, scene.rig.factory, trajectory, "session", options)
          .segments;
  return scene;
}

Eigen::MatrixXd RandomOrthogonal(int size) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(
             Eigen::MatrixXd::Random(size, size))
      .householderQ();
}

TEST(TruncateRoot, CutsOffWhatLiesBelowTheThreshold) {
  std::srand(1);
  Eigen::VectorXd values(6);
  values << 1e4, 300, 20, 5, 1e-3, 0;
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::MatrixXd root =
        RandomOrthogonal(6) * values.asDiagonal() * RandomOrthogonal(6);
    const TruncatedQr qr = TruncateRoot(root, 1);
    EXPECT_EQ(qr.rank, 4);
    EXPECT_EQ(TruncateRoot(root, 1e-5).rank, 5);
  }
}

TEST(TruncateRoot, GivesTheDeterminantOfAFullRoot) {
  std::srand(2);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::MatrixXd root = 100 * Eigen::MatrixXd::Random(6, 6);
    const TruncatedQr qr = TruncateRoot(root, 1e-6);
    EXPECT_EQ(qr.rank, 6);
    EXPECT_NEAR(qr.half_log_det, std::log(std::abs(root.determinant())), 1e-9);
  }
}

// The sparse rank-revealing QR of the whole Jacobian, theta last.
TruncatedQr BySparseQr(const Scene& scene, const MotionSegment& segment) {
  SparseQr qr(BuildSegmentJacobian(
                  scene.rig,
                  scene.rig.factory,
                  segment,
                  SelectInliers(scene.rig, scene.rig.factory, segment, {}),
                  PriorSigmas(scene.rig),
                  0),
              RankDetection::kNone);
  qr.Factorise();
  return TruncateRoot(qr.Root().R, 1);
}

TEST(TruncateInformation, AgreesWithSparseQrOfTheWholeJacobian) {
  const Scene moving = MakeScene(*MakeMixed(21, 3));
  const Scene resting = MakeScene(*MakeRest(9));
  for (const Scene* scene : {&moving, &resting}) {
    for (const MotionSegment& segment : scene->segments) {
      const SegmentInformation information =
          ScoreSegment(scene->rig, scene->rig.factory, segment);
      const TruncatedQr own =
          TruncateInformation(scene->rig, information.Lambda, 1);
      const TruncatedQr reference = BySparseQr(*scene, segment);
      EXPECT_EQ(own.rank, reference.rank) << segment.key.index;
      EXPECT_NEAR(own.half_log_det, reference.half_log_det, 1e-6);
    }
  }
  EXPECT_EQ(BySparseQr(moving, moving.segments.back()).rank, 26);
  EXPECT_LT(BySparseQr(resting, resting.segments.back()).rank, 20);
}

TEST(InformationGain, KeepsNoSegmentThatAddsNothing) {
  // A device that moves for three segments, then rests.
  Scene scene = MakeScene(*MakeHandheld(13, 0.5, 4));
  const std::size_t moving = scene.segments.size();
  const Scene resting = MakeScene(*MakeRest(9), 1);
  for (MotionSegment segment : resting.segments) {
    segment.key.session = "rest";
    scene.segments.push_back(segment);
  }
  const GainResult result =
      RunInformationGain(scene.rig, scene.segments, {.threshold_nats = 1});
  ASSERT_EQ(result.gains.size(), scene.segments.size());
  EXPECT_EQ(result.kept.front(), 0);
  EXPECT_TRUE(result.rank_rose.front());
  for (std::size_t i = moving; i < scene.segments.size(); ++i) {
    EXPECT_LT(result.gains[i], 1) << i;
    EXPECT_FALSE(result.rank_rose[i]);
  }
  EXPECT_LT(result.kept.back(), static_cast<int>(moving));
}

TEST(InformationGain, WithoutAThresholdEndsAtBatch) {
  const Scene scene = MakeScene(*MakeHandheld(13, 0.5, 5));
  const GainResult result = RunInformationGain(
      scene.rig,
      scene.segments,
      {.threshold_nats = -std::numeric_limits<double>::infinity()});
  ASSERT_EQ(result.kept, AllSegments(static_cast<int>(scene.segments.size())));
  const CalibrationResult batch =
      CalibrateOn(scene.rig, scene.segments, result.kept);
  // Both solvers stop where less than 0.05 sigma is left.
  const Eigen::VectorXd apart =
      BoxMinus(result.calibration.theta, batch.theta)
          .cwiseQuotient(batch.covariance.diagonal().cwiseSqrt());
  EXPECT_LT(apart.cwiseAbs().maxCoeff(), 0.05);
}

TEST(InformationGain, StopsAtTheNumberAskedFor) {
  const Scene scene = MakeScene(*MakeHandheld(13, 0.5, 5));
  const GainResult result = RunInformationGain(
      scene.rig,
      scene.segments,
      {.threshold_nats = -std::numeric_limits<double>::infinity(),
       .stop_at = 2});
  EXPECT_EQ(result.kept, (SegmentSet{0, 1}));
  EXPECT_EQ(result.calibration.segments, 2);
}

}  // namespace
}  // namespace selfcal
