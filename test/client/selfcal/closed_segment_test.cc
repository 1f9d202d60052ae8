#include "client/selfcal/closed_segment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>

#include "core/simulation/simulate.h"
#include "test/client/selfcal/simulated_filter.h"

namespace selfcal::client {
namespace {

// The truth of one segment of a device whose images are exposed 7 ms after
// their timestamps, as a filter reports it.
class AssembledSegment : public ::testing::Test {
 protected:
  AssembledSegment() {
    theta_.cameras[0].time_offset_s = 0.007;
    SimulationOptions options;
    options.noise = false;
    const auto trajectory = MakeHandheld(6, 1, 11);
    truth_ =
        Simulate(rig_, theta_, theta_, *trajectory, "s", options).truth.front();
    const FilterSession session =
        MakeFilterSession({truth_}, theta_, *trajectory);
    closed_.key = {"s", 0};
    closed_.imu = session.imu;
    closed_.begin_ns = session.imu.front().t_ns;
    closed_.end_ns = session.imu.back().t_ns;
    closed_.theta = std::make_shared<const Calibration>(theta_);
    for (const FilterStep& step : session.steps) {
      KeyframeState state = step.state;
      state.t_ns = step.image_t_ns;
      closed_.keyframes.push_back(
          {state, step.seen, step.state.t_ns - step.image_t_ns});
    }
    for (const Landmark& landmark : truth_.landmarks) {
      true_p_G_[landmark.id] = landmark.p_G;
    }
  }

  const Rig rig_ = HandheldRig("a");
  Calibration theta_ = rig_.factory;
  MotionSegment truth_;
  ClosedSegment closed_;
  std::map<std::uint64_t, Eigen::Vector3d> true_p_G_;
};

TEST_F(AssembledSegment, HasItsStatesAtTheTimestampsOfTheImages) {
  const MotionSegment segment = Assemble(closed_);
  ASSERT_EQ(segment.keyframes.size(), truth_.keyframes.size());
  for (std::size_t k = 0; k < segment.keyframes.size(); ++k) {
    const KeyframeState& x = segment.keyframes[k];
    const KeyframeState& truth = truth_.keyframes[k];
    EXPECT_EQ(x.t_ns, truth.t_ns);
    EXPECT_LT(x.q_GI.angularDistance(truth.q_GI), 2e-5);
    EXPECT_LT((x.p_GI - truth.p_GI).norm(), 1e-5);
    EXPECT_LT((x.v_GI - truth.v_GI).norm(), 2e-3);
  }
}

TEST_F(AssembledSegment, HasThePositionsOfTracksWithParallax) {
  AssemblyStatistics counts;
  const MotionSegment segment = Assemble(closed_, &counts);
  EXPECT_EQ(counts.tracks_triangulated, segment.landmarks.size());
  EXPECT_EQ(counts.tracks_triangulated + counts.tracks_dropped,
            truth_.landmarks.size());
  EXPECT_GT(counts.tracks_triangulated, 3 * truth_.landmarks.size() / 4);
  for (const Landmark& landmark : segment.landmarks) {
    const Eigen::Vector3d& p_G = true_p_G_.at(landmark.id);
    EXPECT_LT((landmark.p_G - p_G).norm(), 0.02) << landmark.id;
  }
  EXPECT_TRUE(Validate(segment, theta_).empty());
}

TEST_F(AssembledSegment, KeepsThePositionsThatTheSlamSystemHas) {
  const Eigen::Vector3d given(1, 2, 3);
  const std::uint64_t id = closed_.keyframes[5].observations[0].landmark_id;
  for (ObservedKeyframe& keyframe : closed_.keyframes) {
    for (KeyframeObservation& seen : keyframe.observations) {
      // It is known from the sixth keyframe on, and lost in the end.
      const bool known = &keyframe >= &closed_.keyframes[5] &&
                         &keyframe < &closed_.keyframes[30];
      if (seen.landmark_id == id && known) seen.p_G = given;
    }
  }
  AssemblyStatistics counts;
  const MotionSegment segment = Assemble(closed_, &counts);
  const auto found =
      std::find_if(segment.landmarks.begin(),
                   segment.landmarks.end(),
                   [&](const Landmark& l) { return l.id == id; });
  ASSERT_NE(found, segment.landmarks.end());
  EXPECT_EQ(found->p_G, given);
  EXPECT_EQ(counts.tracks_triangulated + 1, segment.landmarks.size());
}

TEST_F(AssembledSegment, TreatsAnImpossiblePositionAsNone) {
  for (ObservedKeyframe& keyframe : closed_.keyframes) {
    for (KeyframeObservation& seen : keyframe.observations) {
      seen.p_G = {1e9, 0, 0};
    }
  }
  const MotionSegment segment = Assemble(closed_);
  EXPECT_FALSE(segment.landmarks.empty());
  EXPECT_TRUE(Validate(segment, theta_).empty());
}

TEST_F(AssembledSegment, LeavesOutTracksIfThetaIsNotKnown) {
  closed_.theta = nullptr;
  AssemblyStatistics counts;
  const MotionSegment segment = Assemble(closed_, &counts);
  EXPECT_EQ(counts.tracks_dropped, truth_.landmarks.size());
  EXPECT_TRUE(segment.landmarks.empty());
  EXPECT_TRUE(segment.observations.empty());
  // Scales of 1 % matter little to a motion of 7 ms.
  EXPECT_LT(segment.keyframes[9].q_GI.angularDistance(truth_.keyframes[9].q_GI),
            1e-3);
}

TEST_F(AssembledSegment, SurvivesACameraThatDoesNotExist) {
  for (KeyframeObservation& seen : closed_.keyframes[3].observations) {
    seen.camera = 5;
  }
  const MotionSegment segment = Assemble(closed_);
  const auto violations = Validate(segment, theta_);
  ASSERT_FALSE(violations.empty()) << "the daemon names it";
  EXPECT_TRUE(violations[0].field.ends_with(".camera"));
}

}  // namespace
}  // namespace selfcal::client
