// The theory holds for scores of simulated segments, linearised at the states
// of a SLAM system with errors.
#include <gtest/gtest.h>

#include <cmath>

#include "core/change/detect_change.h"
#include "core/model/so3.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

class SimulatedSegments : public ::testing::Test {
 protected:
  // Segments of a device with the calibration `truth`.
  std::vector<MotionSegment> Segments(const Calibration& truth,
                                      std::uint64_t seed) const {
    SimulationOptions options;
    options.seed = seed;
    return Simulate(rig_,
                    truth,
                    rig_.factory,
                    *MakeMixed(61, seed),
                    "session",
                    options)
        .segments;
  }

  const Rig rig_ = HandheldRig("a");
  // Known without an error, the strictest case.
  const KnownCalibration active_{rig_.factory, Eigen::MatrixXd::Zero(27, 27)};
  const ConsistencyTester tester_{rig_, active_};
};

TEST_F(SimulatedSegments, AreConsistentWithTheTruth) {
  double sum = 0;
  int degrees = 0;
  int rare = 0;
  int tests = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    std::vector<OffsetInformation> newest;
    for (const MotionSegment& segment : Segments(rig_.factory, seed)) {
      const auto information = ScoreSegment(rig_, rig_.factory, segment);
      ASSERT_TRUE(tester_.Accepts(information));
      newest.push_back(tester_.Offset(information));
      const ConsistencyTest test = tester_.Test(newest.back());
      sum += test.statistic;
      degrees += test.degrees;
      rare += test.probability < 0.01;
      ++tests;
      EXPECT_FALSE(DetectChange(tester_, newest));
    }
  }
  ASSERT_EQ(tests, 150);
  EXPECT_NEAR(sum, degrees, 3 * std::sqrt(2.0 * degrees));
  // 99.9 % of the binomial distribution.
  EXPECT_LE(rare, 6);
}

TEST_F(SimulatedSegments, ShowARotationOfTheCameraByADegree) {
  Calibration turned = rig_.factory;
  CameraCalibration& camera = turned.cameras[0];
  camera.q_CI = camera.q_CI * Exp({0.0174533, 0, 0});
  const auto before = Segments(rig_.factory, 5);
  const auto after = Segments(turned, 5);
  std::vector<OffsetInformation> newest;
  std::optional<Change> change;
  int count = 0;
  for (int i = 0; i < 15 && !change; ++i, ++count) {
    newest.push_back(tester_.Offset(
        ScoreSegment(rig_, rig_.factory, i < 8 ? before[i] : after[i])));
    change = DetectChange(tester_, newest);
  }
  ASSERT_TRUE(change);
  EXPECT_EQ(change->kind, ChangeKind::kSudden);
  EXPECT_LE(change->segments_since, count - 8);
  EXPECT_LE(count - 8, 4);
  EXPECT_EQ(change->concerned, std::vector<std::string>{"extrinsics"});
}

}  // namespace
}  // namespace selfcal
