// Compares the observable directions of the score with the sparse QR of the
// whole Jacobian, on many small segments, most of them of motions that leave
// much unobserved.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>

#include "core/information/segment_information.h"
#include "test/core/information/simple_motions.h"
#include "test/core/information/test_segments.h"
#include "test/reference/segment_jacobian.h"
#include "test/reference/sparse_qr.h"

namespace selfcal {
namespace {

constexpr int kSegments = 1000;
constexpr int kKinds = 7;

struct RandomSegment {
  MotionKind kind = MotionKind::kRest;
  Rig rig;
  Calibration theta0;
  MotionSegment segment;
  int gauge = 0;
};

// FOV, radial-tangential, equidistant, or the latter two side by side.
Rig RandomRig(std::mt19937* random) {
  const auto choice = (*random)() % 4;
  Rig rig = choice == 0 ? HandheldRig("handheld") : TwoCameraRig();
  if (choice == 1) rig.factory.cameras.pop_back();
  if (choice == 2) rig.factory.cameras.erase(rig.factory.cameras.begin());
  if ((*random)() % 4 == 0) rig.fixed = {"cam0.distortion.*", "imu.q_AI.y"};
  return rig;
}

RandomSegment MakeRandomSegment(int index) {
  std::mt19937 random(static_cast<unsigned>(index));
  const auto between = [&](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(random);
  };
  RandomSegment result;
  result.kind = static_cast<MotionKind>(index % kKinds);
  result.rig = RandomRig(&random);
  SimulationOptions options;
  options.seed = random();
  options.keyframes_per_segment = between(6, 10);
  options.landmarks_in_view = between(5, 30);
  options.mean_track_length = between(4, 10);
  const auto trajectory = RandomMotion(
      result.kind,
      (options.keyframes_per_segment + 1) / options.keyframe_rate_hz,
      &random);
  // Truth; or a SLAM system that runs with a factory calibration.
  const bool truth = between(0, 1) == 0;
  result.theta0 =
      truth ? result.rig.factory
            : PerturbCalibration(result.rig.factory, {}, options.seed);
  const SegmentPair pair =
      OneSegment(result.rig, result.theta0, *trajectory, options);
  result.segment = truth ? pair.truth : pair.slam;
  // A blind device.
  if (between(0, 19) == 0) {
    result.segment.observations.clear();
    result.segment.landmarks.clear();
  }
  result.gauge = between(0, options.keyframes_per_segment - 1);
  return result;
}

ReferenceInformation Reference(const RandomSegment& s,
                               const ScoreOptions& options) {
  const std::vector<int> free = FreeComponents(s.rig);
  const Eigen::VectorXd prior = PriorSigmas(s.rig);
  Eigen::VectorXd scale = Eigen::VectorXd::Zero(prior.size());
  scale(free) = prior(free);
  // Without dropping columns: all rank is decided in units of the prior.
  SparseQr qr(
      BuildSegmentJacobian(s.rig,
                           s.theta0,
                           s.segment,
                           SelectInliers(s.rig, s.theta0, s.segment, options),
                           scale,
                           s.gauge),
      RankDetection::kNone);
  qr.Factorise();
  return ReferenceDirections(s.rig, qr.Root().R);
}

// Number of directions with at least as much information from the data as from
// the prior.
int Rank(const Eigen::VectorXd& information) {
  return static_cast<int>((information.array() >= 1).count());
}

// Distance of the information of a direction from the threshold.
double Distance(const Eigen::VectorXd& information) {
  return (information.array() - 1).abs().minCoeff();
}

// Rounding changes information near the threshold by less than this.
constexpr double kRounding = 1e-5;

TEST(RankAgainstReference, IsTheSameOnRandomSegments) {
  double nearest = 1;
  std::array<int, kKinds> unobserved = {};
  for (int i = 0; i < kSegments; ++i) {
    const RandomSegment s = MakeRandomSegment(i);
    SCOPED_TRACE("segment " + std::to_string(i));
    ScoreOptions options;
    options.gauge_keyframe = s.gauge;
    const SegmentInformation score =
        ScoreSegment(s.rig, s.theta0, s.segment, options);
    const ReferenceInformation reference = Reference(s, options);
    EXPECT_EQ(score.rank, Rank(reference.whole)) << reference.whole.transpose();
    nearest = std::min(nearest, Distance(reference.whole));
    ASSERT_EQ(score.groups.size(), reference.groups.size());
    for (std::size_t q = 0; q < score.groups.size(); ++q) {
      const Eigen::VectorXd& group = reference.groups[q];
      EXPECT_EQ(score.groups[q].rank, Rank(group)) << group.transpose();
      nearest = std::min(nearest, Distance(group));
    }
    unobserved[i % kKinds] +=
        static_cast<int>(reference.whole.size()) - Rank(reference.whole);
  }
  // No direction is a tie, so that no decision is excused.
  EXPECT_GT(nearest, kRounding);
  for (const int directions : unobserved) EXPECT_GT(directions, 0);
}

}  // namespace
}  // namespace selfcal
