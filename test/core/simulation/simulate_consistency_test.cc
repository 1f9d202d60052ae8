// Compares simulated readings and pixels with the factors of an estimator.
#include <gtest/gtest.h>

#include <cmath>

#include "core/factor/inertial.h"
#include "core/factor/reprojection.h"
#include "core/simulation/simulate.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

Eigen::Vector2d Residual(const MotionSegment& segment,
                         const Calibration& theta,
                         const Observation& observation,
                         const KeyframeMotions& motions = {}) {
  const KeyframeState& x = segment.keyframes[observation.keyframe];
  const Eigen::Vector3d& p_G = segment.landmarks[observation.landmark].p_G;
  Eigen::Vector2d residual_px;
  const bool projected =
      Reproject(x.q_GI,
                x.p_GI,
                theta.cameras[observation.camera],
                p_G.homogeneous(),
                observation.z_px,
                &residual_px,
                nullptr,
                motions.At(observation.keyframe, observation.camera));
  EXPECT_TRUE(projected);
  return residual_px;
}

// Root mean square of the rotation, velocity and position residuals between
// the keyframes of all segments.
Eigen::Vector3d InertialRms(const std::vector<MotionSegment>& segments,
                            const Rig& rig) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const MotionSegment& segment : segments) {
    for (std::size_t k = 0; k + 1 < segment.keyframes.size(); ++k) {
      const InertialResidual r = EvaluateInertial(segment.imu,
                                                  segment.keyframes[k],
                                                  segment.keyframes[k + 1],
                                                  rig.factory.imu,
                                                  rig.imu_noise,
                                                  rig.gravity_mps2,
                                                  nullptr,
                                                  nullptr);
      for (int i = 0; i < 3; ++i) sum[i] += r.segment<3>(3 * i).squaredNorm();
      ++count;
    }
  }
  return (sum / count).cwiseSqrt();
}

TEST(SimulateConsistencyTest, WithoutNoisePixelsAreThoseOfTheFactor) {
  for (const Rig& rig : {HandheldRig("a"), StereoRig()}) {
    SimulationOptions options;
    options.noise = false;
    const SimulatedSession session = SimulateHandheld(rig, 20, options);
    for (std::size_t s = 0; s < session.truth.size(); ++s) {
      const MotionSegment& truth = session.truth[s];
      for (std::size_t i = 0; i < truth.observations.size(); ++i) {
        const Observation& z = truth.observations[i];
        ASSERT_LT(Residual(truth, rig.factory, z).norm(), 1e-9);
        ASSERT_EQ(z.z_px, session.segments[s].observations[i].z_px);
      }
    }
  }
}

// Cameras that are exposed before and after the keyframes.
Rig LateRig() {
  Rig rig = StereoRig();
  rig.factory.cameras[0].time_offset_s = 0.03;
  rig.factory.cameras[1].time_offset_s = -0.02;
  return rig;
}

// The error is that of the factor's integration of IMU samples: for offsets of
// 30 ms it is far below the noise of a pixel, except for the first keyframe of
// a segment, before which there are no samples.
TEST(SimulateConsistencyTest, WithATimeOffsetPixelsAreThoseOfTheMovedPose) {
  const Rig rig = LateRig();
  SimulationOptions options;
  options.noise = false;
  const SimulatedSession session = SimulateHandheld(rig, 20, options);
  double first = 0, others = 0;
  int count = 0, first_count = 0;
  for (const MotionSegment& truth : session.truth) {
    const KeyframeMotions motions = SegmentMotions(rig, rig.factory, truth);
    for (const Observation& z : truth.observations) {
      const double square =
          Residual(truth, rig.factory, z, motions).squaredNorm();
      if (z.keyframe == 0) {
        ++first_count;
        first += square;
        continue;
      }
      ++count;
      others += square;
    }
  }
  EXPECT_LT(std::sqrt(others / count), 0.02 * rig.pixel_sigma_px);
  EXPECT_LT(std::sqrt(first / first_count), 0.5 * rig.pixel_sigma_px);
}

TEST(SimulateConsistencyTest, WithoutNoiseReadingsAreThoseOfTheFactor) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.noise = false;
  const SimulatedSession coarse = SimulateHandheld(rig, 30, options);
  const Eigen::Vector3d at_200 = InertialRms(coarse.truth, rig);
  // The remaining error is that of the linear interpolation between samples:
  // less than a fifth of the effect of the noise of the readings in 0.1 s.
  const double dt_s = 0.1;
  const ImuNoise& noise = rig.imu_noise;
  const double gyro = noise.gyro_noise_density * std::sqrt(3 * dt_s);
  const double accel = noise.accel_noise_density * std::sqrt(3 * dt_s);
  EXPECT_LT(at_200[0], gyro / 5);
  EXPECT_LT(at_200[1], accel / 5);
  EXPECT_LT(at_200[2], accel * dt_s / std::sqrt(3) / 5);
  // It decreases with the square of the step: there is no other error.
  options.imu_rate_hz = 800;
  const Eigen::Vector3d at_800 =
      InertialRms(SimulateHandheld(rig, 30, options).truth, rig);
  for (int i = 0; i < 3; ++i) EXPECT_LT(at_800[i], at_200[i] / 12);
  for (const MotionSegment& truth : coarse.truth) {
    for (const KeyframeState& x : truth.keyframes) {
      ASSERT_EQ(x.b_a, options.b_a0);
      ASSERT_EQ(x.b_g, options.b_g0);
    }
  }
}

TEST(SimulateConsistencyTest,
     ResidualsAtTheTruthAreAsLargeAsTheirCovarianceSays) {
  const Rig rig = HandheldRig("a");
  const SimulatedSession session = SimulateHandheld(rig, 180, {});
  InertialResidual sum = InertialResidual::Zero();
  int count = 0;
  for (std::size_t s = 0; s < session.truth.size(); ++s) {
    const MotionSegment& truth = session.truth[s];
    for (std::size_t k = 0; k + 1 < truth.keyframes.size(); ++k, ++count) {
      InertialMatrix covariance;
      const InertialResidual r = EvaluateInertial(session.segments[s].imu,
                                                  truth.keyframes[k],
                                                  truth.keyframes[k + 1],
                                                  rig.factory.imu,
                                                  rig.imu_noise,
                                                  rig.gravity_mps2,
                                                  nullptr,
                                                  &covariance);
      sum += (SquareRootInformation(covariance) * r).cwiseAbs2();
    }
  }
  // Interpolation between samples filters a little of the white noise: the
  // mean square of each whitened component is near 1, or just below.
  for (int i = 0; i < 15; ++i) {
    EXPECT_GT(sum[i] / count, 0.8) << i;
    EXPECT_LT(sum[i] / count, 1.2) << i;
  }
}

TEST(SimulateConsistencyTest, PixelNoiseHasTheSigmaOfTheRig) {
  const Rig rig = StereoRig();
  const SimulatedSession session = SimulateHandheld(rig, 40, {});
  double sum = 0;
  double count = 0;
  for (std::size_t s = 0; s < session.segments.size(); ++s) {
    for (std::size_t i = 0; i < session.truth[s].observations.size(); ++i) {
      const Observation& truth = session.truth[s].observations[i];
      const Observation& z = session.segments[s].observations[i];
      ASSERT_EQ(truth.keyframe, z.keyframe);
      ASSERT_EQ(truth.camera, z.camera);
      ASSERT_EQ(truth.landmark, z.landmark);
      sum += (z.z_px - truth.z_px).squaredNorm() / 2;
      ++count;
    }
  }
  EXPECT_NEAR(std::sqrt(sum / count), rig.pixel_sigma_px, 0.01);
}

TEST(SimulateConsistencyTest, StartsNearEnoughForAnEstimator) {
  const Rig rig = HandheldRig("a");
  const Calibration slam = PerturbCalibration(rig.factory, {}, 1);
  const SimulatedSession session = SimulateHandheld(rig, 60, {});
  double sum = 0;
  double count = 0;
  for (const MotionSegment& segment : session.segments) {
    for (const Observation& z : segment.observations) {
      sum += Residual(segment, slam, z).squaredNorm() / 2;
      ++count;
    }
  }
  // Larger than the noise, since the SLAM system is wrong; but of its order.
  EXPECT_GT(std::sqrt(sum / count), rig.pixel_sigma_px);
  EXPECT_LT(std::sqrt(sum / count), 5 * rig.pixel_sigma_px);
}

TEST(SimulateConsistencyTest, ASlamSystemWithoutTheOffsetFollowsItsImages) {
  Rig rig = HandheldRig("late");
  const Calibration slam = rig.factory;
  rig.factory.cameras[0].time_offset_s = 0.02;
  SimulationOptions options = PerfectSlam();
  options.noise = false;
  const SimulatedSession session = Simulate(
      rig, rig.factory, slam, *MakeHandheld(20, 1, 2), "session", options);
  double sum = 0;
  double count = 0;
  for (const MotionSegment& segment : session.segments) {
    for (const Observation& z : segment.observations) {
      sum += Residual(segment, slam, z).squaredNorm();
      ++count;
    }
  }
  // Its motion from keyframe to keyframe is not that of its IMU; pixels agree.
  EXPECT_LT(std::sqrt(sum / count), 1e-3);
  EXPECT_GT(InertialRms(session.segments, rig)[0],
            10 * InertialRms(session.truth, rig)[0]);
}

TEST(SimulateConsistencyTest, APerfectSlamSystemHandsOverTheTruth) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options = PerfectSlam();
  options.noise = false;
  const SimulatedSession session = Simulate(rig,
                                            rig.factory,
                                            rig.factory,
                                            *MakeHandheld(20, 1, 2),
                                            "session",
                                            options);
  for (std::size_t s = 0; s < session.segments.size(); ++s) {
    const MotionSegment& segment = session.segments[s];
    const MotionSegment& truth = session.truth[s];
    for (std::size_t k = 0; k < truth.keyframes.size(); ++k) {
      const KeyframeState& x = segment.keyframes[k];
      EXPECT_LT((x.p_GI - truth.keyframes[k].p_GI).norm(), 1e-12);
      EXPECT_LT(x.q_GI.angularDistance(truth.keyframes[k].q_GI), 1e-7);
      EXPECT_LT((x.b_a - truth.keyframes[k].b_a).norm(), 1e-12);
    }
    for (std::size_t m = 0; m < truth.landmarks.size(); ++m) {
      EXPECT_LT((segment.landmarks[m].p_G - truth.landmarks[m].p_G).norm(),
                1e-9);
    }
  }
}

}  // namespace
}  // namespace selfcal
