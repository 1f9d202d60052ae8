#include "test/evaluation/slam_estimator.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"

namespace selfcal {
namespace {

struct Example {
  Rig rig;
  SimulatedSession session;
};

Example MakeExample(const Calibration& theta_slam, bool noise) {
  Example example{HandheldRig("a"), {}};
  SimulationOptions options;
  options.seed = 5;
  options.landmarks_in_view = 40;
  options.keyframes_per_segment = 20;
  options.revisit_fraction = 0;
  options.noise = noise;
  example.session = Simulate(example.rig,
                             example.rig.factory,
                             theta_slam,
                             *MakeHandheld(6.5, 1, 5),
                             "session",
                             options);
  return example;
}

// Without what position and heading begin with: relative to the first keyframe.
double RelativePositionError(const std::vector<MotionSegment>& estimated,
                             const std::vector<MotionSegment>& truth) {
  const KeyframeState& a0 = estimated.front().keyframes.front();
  const KeyframeState& b0 = truth.front().keyframes.front();
  double square = 0;
  int count = 0;
  for (std::size_t s = 0; s < truth.size(); ++s) {
    for (std::size_t k = 0; k < truth[s].keyframes.size(); ++k) {
      const Eigen::Vector3d a =
          a0.q_GI.conjugate() * (estimated[s].keyframes[k].p_GI - a0.p_GI);
      const Eigen::Vector3d b =
          b0.q_GI.conjugate() * (truth[s].keyframes[k].p_GI - b0.p_GI);
      square += (a - b).squaredNorm();
      ++count;
    }
  }
  return std::sqrt(square / count);
}

double MeanAccelBiasError(const std::vector<MotionSegment>& estimated,
                          const std::vector<MotionSegment>& truth) {
  double sum = 0;
  int count = 0;
  for (std::size_t s = 0; s < truth.size(); ++s) {
    for (std::size_t k = 0; k < truth[s].keyframes.size(); ++k, ++count) {
      sum += (estimated[s].keyframes[k].b_a - truth[s].keyframes[k].b_a).norm();
    }
  }
  return sum / count;
}

TEST(SlamEstimatorTest, WithTheTrueCalibrationAndPerfectDataStatesAreTheTruth) {
  const Example example = MakeExample(HandheldRig("a").factory, false);
  const auto estimated = EstimateStates(example.rig,
                                        example.rig.factory,
                                        example.session.segments,
                                        {.max_iterations = 30});
  // What it is given is off by 5 mm and 2 mrad.
  EXPECT_GT(
      RelativePositionError(example.session.segments, example.session.truth),
      5e-3);
  EXPECT_LT(RelativePositionError(estimated, example.session.truth), 1e-3);
  EXPECT_LT(MeanAccelBiasError(estimated, example.session.truth), 5e-3);
}

// A wrong calibration shows in states that are wrong together: biases take what
// it gets wrong, and the path is bent. Noise alone does much less.
TEST(SlamEstimatorTest, WithAWrongCalibrationStatesAreWrongTogether) {
  const Calibration right = HandheldRig("a").factory;
  const Calibration wrong = PerturbCalibration(right, {}, 5);
  const Example example = MakeExample(wrong, true);
  const auto by_right =
      EstimateStates(example.rig, right, example.session.segments);
  const auto by_wrong =
      EstimateStates(example.rig, wrong, example.session.segments);
  EXPECT_GT(RelativePositionError(by_wrong, example.session.truth),
            2 * RelativePositionError(by_right, example.session.truth));
  EXPECT_GT(MeanAccelBiasError(by_wrong, example.session.truth),
            2 * MeanAccelBiasError(by_right, example.session.truth));
}

TEST(SlamEstimatorTest, SegmentsKeepTheirDataAndStayValid) {
  const Calibration wrong = PerturbCalibration(HandheldRig("a").factory, {}, 6);
  const Example example = MakeExample(wrong, true);
  // Stretches that end within the session.
  const auto estimated = EstimateStates(
      example.rig, wrong, example.session.segments, {.stretch = 2});
  ASSERT_EQ(estimated.size(), example.session.segments.size());
  for (std::size_t s = 0; s < estimated.size(); ++s) {
    const MotionSegment& given = example.session.segments[s];
    EXPECT_TRUE(Validate(estimated[s], example.rig.factory).empty());
    ASSERT_EQ(estimated[s].observations.size(), given.observations.size());
    EXPECT_EQ(estimated[s].observations[3].z_px, given.observations[3].z_px);
    EXPECT_EQ(estimated[s].keyframes[3].t_ns, given.keyframes[3].t_ns);
    EXPECT_NE(estimated[s].keyframes[3].p_GI, given.keyframes[3].p_GI);
  }
}

}  // namespace
}  // namespace selfcal
