// Motion from tracks and readings against the truth of simulated devices.
#include "core/motion/estimate_motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/theta_prior.h"
#include "core/simulation/simulate.h"
#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

// The segment as a front end has it: times, readings and tracks.
MotionSegment TracksOf(const MotionSegment& segment) {
  MotionSegment tracks = segment;
  for (KeyframeState& x : tracks.keyframes) {
    x = {.t_ns = x.t_ns};
  }
  for (Landmark& landmark : tracks.landmarks) {
    landmark.p_G.setZero();
  }
  return tracks;
}

// Differences of an estimated motion from the true one, without the gauge:
// seen from the first keyframe.
struct MotionError {
  double position_m = 0;  // largest
  double speed_mps = 0;
  double rotation_rad = 0;  // of the last keyframe
  double tilt_rad = 0;      // of gravity in the first one
  double scale = 0;         // of the path
  double gyro_bias_radps = 0;
};

MotionError Compare(const MotionSegment& estimate, const MotionSegment& truth) {
  MotionError error;
  const KeyframeState& a_0 = estimate.keyframes.front();
  const KeyframeState& b_0 = truth.keyframes.front();
  double of_estimate = 0, of_truth = 0;
  for (std::size_t k = 0; k < truth.keyframes.size(); ++k) {
    const KeyframeState& a = estimate.keyframes[k];
    const KeyframeState& b = truth.keyframes[k];
    const Eigen::Vector3d p_a = a_0.q_GI.conjugate() * (a.p_GI - a_0.p_GI);
    const Eigen::Vector3d p_b = b_0.q_GI.conjugate() * (b.p_GI - b_0.p_GI);
    error.position_m = std::max(error.position_m, (p_a - p_b).norm());
    error.speed_mps = std::max(
        error.speed_mps,
        (a_0.q_GI.conjugate() * a.v_GI - b_0.q_GI.conjugate() * b.v_GI).norm());
    of_estimate += p_a.dot(p_b);
    of_truth += p_b.squaredNorm();
    error.gyro_bias_radps =
        std::max(error.gyro_bias_radps, (a.b_g - b.b_g).norm());
  }
  error.scale = of_estimate / of_truth - 1;
  error.rotation_rad =
      (a_0.q_GI.conjugate() * estimate.keyframes.back().q_GI)
          .angularDistance(b_0.q_GI.conjugate() * truth.keyframes.back().q_GI);
  error.tilt_rad = std::acos(
      std::min(1.0,
               (a_0.q_GI.conjugate() * Eigen::Vector3d::UnitZ())
                   .dot(b_0.q_GI.conjugate() * Eigen::Vector3d::UnitZ())));
  return error;
}

SimulatedSession Simulated(const Rig& rig,
                           std::uint64_t seed,
                           double seconds,
                           double amplitude) {
  SimulationOptions options;
  options.seed = seed;
  options.outlier_fraction = 0.02;
  return Simulate(rig,
                  rig.factory,
                  rig.factory,
                  *MakeHandheld(seconds, amplitude, seed),
                  "session",
                  options);
}

void ExpectMotions(const Rig& rig, double amplitude, double max_scale_error) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const SimulatedSession session = Simulated(rig, seed, 12.2, amplitude);
    ASSERT_EQ(session.segments.size(), 3u);
    for (std::size_t i = 0; i < session.segments.size(); ++i) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", segment " +
                   std::to_string(i));
      MotionSegment segment = TracksOf(session.segments[i]);
      const MotionEstimate estimate =
          EstimateMotion(rig, rig.factory, {}, &segment);
      EXPECT_EQ(estimate.failure, "");
      EXPECT_GT(estimate.used, 0.9 * estimate.observations);
      EXPECT_LT(estimate.reprojection_rms_px, 1.2);
      const MotionError error = Compare(segment, session.truth[i]);
      EXPECT_LT(error.position_m, 0.01);
      EXPECT_LT(error.speed_mps, 0.04);
      EXPECT_LT(error.rotation_rad, 4e-3);
      EXPECT_LT(error.tilt_rad, 0.01);
      EXPECT_LT(std::abs(error.scale), max_scale_error);
      EXPECT_LT(error.gyro_bias_radps, 1.5e-3);
      EXPECT_TRUE(Validate(segment, rig.factory).empty());
    }
  }
}

TEST(EstimateMotion, OfOneCamera) {
  ExpectMotions(HandheldRig("handheld"), 1, 0.005);
  ExpectMotions(HandheldRig("handheld"), 0.3, 0.015);
}

TEST(EstimateMotion, OfTwoCameras) { ExpectMotions(TwoCameraRig(), 1, 0.005); }

TEST(EstimateMotion, OfARollingShutterWithAnOffset) {
  Rig rig = HandheldRig("rolling");
  rig.factory.cameras[0].time_offset_s = 0.02;
  rig.factory.cameras[0].line_delay_s = 40e-6;
  ExpectMotions(rig, 1, 0.005);
}

// Calibrations of a device of which little is known: a focal length that is off
// by 5 %, a principal point by 10 px, 3 degrees, 5 cm, 20 ms, and a bias of 2
// deg/s. The states then err by decimetres, and suffice as a start.
void ExpectCalibration(const Rig& truth, std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.outlier_fraction = 0.02;
  options.b_g0 = {0.004, 0.03, -0.02};
  const SimulatedSession session = Simulate(truth,
                                            truth.factory,
                                            truth.factory,
                                            *MakeHandheld(24.2, 1, seed),
                                            "session",
                                            options);
  Rig rig = truth;
  rig.factory = PerturbCalibration(truth.factory,
                                   {.focal_relative = 0.05,
                                    .principal_point_px = 10,
                                    .distortion_relative = 0.05,
                                    .camera_rotation_rad = 0.0524,
                                    .camera_position_m = 0.05},
                                   seed + 100);
  for (CameraCalibration& camera : rig.factory.cameras) {
    camera.time_offset_s = 0.02;
  }
  rig.blocks = {{"*.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  rig.prior_sigmas = {{"*.focal.*", 20},
                      {"*.principal.*", 10},
                      {"*.p_CI.*", 0.05},
                      {"*.q_CI.*", 0.06},
                      {"*.time_offset", 0.02}};
  std::vector<MotionSegment> segments;
  for (const MotionSegment& one : session.segments) {
    MotionSegment segment = TracksOf(one);
    const MotionEstimate estimate =
        EstimateMotion(rig, rig.factory, {}, &segment);
    EXPECT_EQ(estimate.failure, "");
    segments.push_back(segment);
  }
  CalibrateOptions calibrate;
  calibrate.prior = FactoryPrior(rig);
  const CalibrationResult result =
      Calibrate(rig, rig.factory, segments, calibrate);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  EXPECT_EQ(result.segments, static_cast<int>(segments.size()));
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd error = BoxMinus(result.theta, truth.factory)(free);
  const Eigen::MatrixXd covariance = result.covariance(free, free);
  const double nees = error.dot(covariance.ldlt().solve(error));
  const auto n = static_cast<double>(free.size());
  // Four standard deviations of a chi-squared distribution.
  EXPECT_LT(nees, n + 4 * std::sqrt(2 * n));
}

TEST(EstimateMotion, SufficesForACalibrationFromAPoorStart) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    ExpectCalibration(HandheldRig("handheld"), seed);
    ExpectCalibration(TwoCameraRig(), seed);
  }
}

TEST(EstimateMotion, ContinuesTheSegmentBefore) {
  const Rig rig = HandheldRig("handheld");
  const SimulatedSession session = Simulated(rig, 7, 12.2, 1);
  MotionSegment first = TracksOf(session.segments[0]);
  ASSERT_EQ(EstimateMotion(rig, rig.factory, {}, &first).failure, "");
  MotionSegment second = TracksOf(session.segments[1]);
  const KeyframeState carried = CarryOn(rig,
                                        rig.factory,
                                        first.keyframes.back(),
                                        first.imu,
                                        second.keyframes.front().t_ns);
  const MotionStart start{carried.b_a, carried.b_g, carried};
  ASSERT_EQ(EstimateMotion(rig, rig.factory, start, &second).failure, "");
  // Position and yaw are those that were carried on, and the tilt is estimated.
  const KeyframeState& x = second.keyframes.front();
  EXPECT_LT((x.p_GI - carried.p_GI).norm(), 1e-9);
  EXPECT_LT(x.q_GI.angularDistance(carried.q_GI), 5e-3);
  // Both are in one frame: seen from the first keyframe of all, the last one is
  // where it is in truth.
  const KeyframeState& a = first.keyframes.front();
  const KeyframeState& b = session.truth[0].keyframes.front();
  const Eigen::Vector3d estimated =
      a.q_GI.conjugate() * (second.keyframes.back().p_GI - a.p_GI);
  const Eigen::Vector3d truth =
      b.q_GI.conjugate() * (session.truth[1].keyframes.back().p_GI - b.p_GI);
  EXPECT_LT((estimated - truth).norm(), 0.03);
}

TEST(EstimateMotion, SaysThatADeviceAtRestHasNone) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment segment = TracksOf(RestingSegment(rig, 3));
  EXPECT_EQ(EstimateMotion(rig, rig.factory, {}, &segment).failure,
            "too few landmarks have parallax");
}

TEST(EstimateMotion, SaysThatTracksOfAnotherMotionDoNotAgree) {
  const Rig rig = HandheldRig("handheld");
  for (std::uint64_t seed = 2; seed <= 8; ++seed) {
    MotionSegment segment = TracksOf(Simulated(rig, 1, 4.2, 1).segments[0]);
    const MotionSegment other = Simulated(rig, seed, 4.2, 1).segments[0];
    segment.landmarks = other.landmarks;
    segment.observations = other.observations;
    EXPECT_EQ(EstimateMotion(rig, rig.factory, {}, &segment).failure,
              "most of the tracks do not agree with one motion");
  }
}

TEST(EstimateMotion, SaysThatThereAreNoTracks) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment segment = TracksOf(Simulated(rig, 1, 4.2, 1).segments[0]);
  segment.landmarks.clear();
  segment.observations.clear();
  EXPECT_NE(EstimateMotion(rig, rig.factory, {}, &segment).failure, "");
}

TEST(AlignMotion, IsNearTheTruthWithoutIterationsOnStates) {
  for (const Rig& rig : {HandheldRig("handheld"), TwoCameraRig()}) {
    const SimulatedSession session = Simulated(rig, 11, 12.2, 1);
    for (std::size_t i = 0; i < session.segments.size(); ++i) {
      MotionSegment segment = TracksOf(session.segments[i]);
      ASSERT_TRUE(AlignMotion(rig, rig.factory, {}, &segment));
      const MotionError error = Compare(segment, session.truth[i]);
      EXPECT_LT(std::abs(error.scale), 0.1);
      EXPECT_LT(error.tilt_rad, 0.05);
      EXPECT_LT(error.position_m, 0.15);
    }
  }
}

}  // namespace
}  // namespace selfcal
