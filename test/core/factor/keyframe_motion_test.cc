#include "core/factor/keyframe_motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "test/core/factor/analytic_motion.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;

constexpr double kMotionGravity = 9.83;
constexpr std::int64_t kPeriod_ns = 5'000'000;
constexpr std::int64_t kKeyframe_ns = 501'700'000;

// A keyframe of a shaken device with the samples about it.
struct Scene {
  explicit Scene(RandomValues& random)
      : Scene(AnalyticMotion(random), random.Imu(), random) {}
  Scene(const AnalyticMotion& motion,
        const ImuCalibration& imu,
        RandomValues& random)
      : motion(motion), imu(imu), x(motion.State(kKeyframe_ns)) {
    x.b_a = random.Normal3(0.2);
    x.b_g = random.Normal3(0.02);
    samples = motion.Readings(
        0, 1'000'000'000, kPeriod_ns, imu, x.b_a, x.b_g, kMotionGravity);
  }

  KeyframeMotion Measure(double dt_s) const {
    return MeasureMotion(samples, x, imu, {}, kMotionGravity, dt_s);
  }
  KeyframeState Truth(double dt_s) const {
    return motion.State(kKeyframe_ns + std::llround(dt_s * 1e9));
  }

  AnalyticMotion motion;
  ImuCalibration imu;
  KeyframeState x;
  std::vector<ImuSample> samples;
};

// For a camera of f = 500 px in the body's origin: an upper bound of the pixel
// error of points at a distance of 1 m.
double ErrorPixels(const ExposurePose& pose, const KeyframeState& truth) {
  return 500 * (Log(pose.q_GI.conjugate() * truth.q_GI).norm() +
                (pose.p_GI - truth.p_GI).norm());
}

TEST(MeasureMotion, MovesThePoseToTheExposure) {
  RandomValues random(1);
  for (int trial = 0; trial < 500; ++trial) {
    const AnalyticMotion shaken(random);
    const Scene scene(
        shaken, trial % 2 == 0 ? random.Imu() : random.CoupledImu(), random);
    const double dt_s = random.Uniform(-0.03, 0.03);
    const KeyframeMotion motion = scene.Measure(dt_s);
    const KeyframeState truth = scene.Truth(dt_s);
    const ExposurePose pose =
        MovePose(scene.x.q_GI, scene.x.p_GI, motion, dt_s);
    EXPECT_LT(ErrorPixels(pose, truth), 0.02);
    EXPECT_LT((scene.x.q_GI * motion.v_I - truth.v_GI).norm(), 1e-3);
    // An error of the rate of 1 % makes the offset's sigma that much wrong.
    const double h_s = 1e-4;
    const Vector3d w_I =
        Log(truth.q_GI.conjugate() * scene.Truth(dt_s + h_s).q_GI) / h_s;
    EXPECT_LT((motion.w_I - w_I).norm(), 0.01 * (1 + w_I.norm()));
  }
}

// Within an iteration the offset moves along the tangent.
TEST(MeasureMotion, IsFollowedAlongItsRatesToOtherOffsets) {
  RandomValues random(2);
  for (int trial = 0; trial < 500; ++trial) {
    const Scene scene(random);
    const double dt_s = random.Uniform(-0.03, 0.03);
    const double by_s = random.Uniform(-0.001, 0.001);
    const ExposurePose pose =
        MovePose(scene.x.q_GI, scene.x.p_GI, scene.Measure(dt_s), dt_s + by_s);
    EXPECT_LT(ErrorPixels(pose, scene.Truth(dt_s + by_s)), 0.05);
  }
}

TEST(MeasureMotion, GoesOnWhereTheSamplesEnd) {
  RandomValues random(3);
  double sum_px2 = 0;
  constexpr int kTrials = 500;
  for (int trial = 0; trial < kTrials; ++trial) {
    Scene scene(random);
    const bool after = trial % 2 == 0;
    std::erase_if(scene.samples, [&](const ImuSample& sample) {
      return after ? sample.t_ns > kKeyframe_ns + kPeriod_ns
                   : sample.t_ns < kKeyframe_ns - kPeriod_ns;
    });
    const double dt_s = (after ? 1 : -1) * random.Uniform(0, 0.03);
    const ExposurePose pose =
        MovePose(scene.x.q_GI, scene.x.p_GI, scene.Measure(dt_s), dt_s);
    const double error_px = ErrorPixels(pose, scene.Truth(dt_s));
    sum_px2 += error_px * error_px;
  }
  EXPECT_LT(std::sqrt(sum_px2 / kTrials), 0.3);
}

// The polynomials of a readout against the true motion, and against a motion at
// the rates of the middle row alone.
TEST(MeasureMotion, MovesThePoseToEachRowOfARollingShutter) {
  for (const double readout_s : {0.010, 0.020, 0.033, -0.033}) {
    RandomValues random(9);
    double worst_px = 0, worst_at_rates_px = 0;
    for (int trial = 0; trial < 300; ++trial) {
      const Scene scene(random);
      CameraCalibration camera;
      camera.height_px = 480;
      camera.time_offset_s = random.Uniform(-0.03, 0.03);
      camera.line_delay_s = readout_s / camera.height_px;
      const KeyframeMotion motion = MeasureMotion(
          {scene.samples}, scene.x, scene.imu, {}, kMotionGravity, camera);
      for (const double row_px : {0.0, 100.5, 240.0, 333.0, 479.0}) {
        const double dt_s =
            camera.time_offset_s + *camera.line_delay_s * row_px;
        const ExposurePose pose = MovePose(scene.x.q_GI,
                                           scene.x.p_GI,
                                           motion,
                                           camera,
                                           Eigen::Vector2d(7, row_px));
        worst_px = std::max(worst_px, ErrorPixels(pose, scene.Truth(dt_s)));
        const ExposurePose at_rates =
            MovePose(scene.x.q_GI, scene.x.p_GI, motion, dt_s);
        worst_at_rates_px = std::max(worst_at_rates_px,
                                     ErrorPixels(at_rates, scene.Truth(dt_s)));
        const double h_s = 1e-4;
        const KeyframeState before = scene.Truth(dt_s - h_s);
        const KeyframeState after = scene.Truth(dt_s + h_s);
        Eigen::Matrix<double, 6, 1> by_time;
        by_time << Log(before.q_GI.conjugate() * after.q_GI) / (2 * h_s),
            (after.p_GI - before.p_GI) / (2 * h_s);
        EXPECT_LT((pose.by_time - by_time).norm(), 0.01 * (1 + by_time.norm()));
      }
    }
    std::printf("readout %.0f ms: off by at most %.3f px, at rates %.2f px\n",
                1e3 * readout_s,
                worst_px,
                worst_at_rates_px);
    // It is integrated over twice the time of MovesThePoseToTheExposure.
    EXPECT_LT(worst_px, 0.05);
  }
}

// To the middle row and back, over the same samples: the first row or the last
// one is exposed at the time of the keyframe, but for a rounding error of
// either sign.
TEST(MeasureMotion, OfARowAtTheKeyframesTimeIsNone) {
  RandomValues random(11);
  for (int trial = 0; trial < 100; ++trial) {
    Scene scene(random);
    for (ImuSample& sample : scene.samples) {
      sample.gyro += random.Normal3(0.05);
      sample.accel += random.Normal3(0.5);
    }
    CameraCalibration camera;
    camera.height_px = 481;
    const double readout_s = trial % 2 == 0 ? 0.03 : -0.03;
    const double last_row_px = camera.height_px - 1;
    camera.line_delay_s = readout_s / last_row_px;
    for (const double row_px : {0.0, last_row_px}) {
      for (const double off_s : {-1e-9, 1e-9}) {
        camera.time_offset_s = off_s - *camera.line_delay_s * row_px;
        const KeyframeMotion motion = MeasureMotion(
            {scene.samples}, scene.x, scene.imu, {}, kMotionGravity, camera);
        const ExposurePose pose = MovePose(scene.x.q_GI,
                                           scene.x.p_GI,
                                           motion,
                                           camera,
                                           Eigen::Vector2d(7, row_px));
        EXPECT_LT(ErrorPixels(pose, scene.x), 0.01);
      }
    }
  }
}

// Samples for kImuPadding_s about a keyframe are as good as all of them, at
// exposures up to 0.1 s before it and 0.135 s after it.
TEST(MeasureMotion, NeedsNoSamplesBeyondThePadding) {
  RandomValues random(9);
  const auto padding_ns = static_cast<std::int64_t>(kImuPadding_s * 1e9);
  double worst_px = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Scene scene(random);
    const double dt_s = random.Uniform(-0.1, 0.135);
    const KeyframeMotion all = scene.Measure(dt_s);
    Scene beside = scene;  // only the samples on the other side
    std::erase_if(scene.samples, [&](const ImuSample& sample) {
      return std::abs(sample.t_ns - kKeyframe_ns) > padding_ns;
    });
    std::erase_if(beside.samples, [&](const ImuSample& sample) {
      return (sample.t_ns > kKeyframe_ns) == (dt_s > 0);
    });
    const KeyframeMotion padded = scene.Measure(dt_s);
    EXPECT_EQ(padded.turn.coeffs(), all.turn.coeffs());
    EXPECT_EQ(padded.shift_I, all.shift_I);
    EXPECT_EQ(padded.v_I, all.v_I);
    EXPECT_EQ(padded.w_I, all.w_I);
    worst_px = std::max(
        worst_px,
        ErrorPixels(
            MovePose(scene.x.q_GI, scene.x.p_GI, beside.Measure(dt_s), dt_s),
            scene.Truth(dt_s)));
  }
  EXPECT_GT(worst_px, 10) << "the padding matters";
}

TEST(MeasureMotion, WithoutAnOffsetThePoseStays) {
  RandomValues random(4);
  const Scene scene(random);
  const KeyframeMotion motion = scene.Measure(0);
  const ExposurePose pose = MovePose(scene.x.q_GI, scene.x.p_GI, motion, 0);
  EXPECT_EQ(pose.q_GI.coeffs(), scene.x.q_GI.coeffs());
  EXPECT_EQ(pose.p_GI, scene.x.p_GI);
  EXPECT_TRUE(pose.by_rotation.isIdentity(0));
  EXPECT_LT((pose.by_time.tail<3>() - scene.x.v_GI).norm(), 1e-14);
}

TEST(MeasureMotion, HoldsASingleSample) {
  RandomValues random(5);
  Scene scene(random);
  scene.samples.resize(1);
  const KeyframeMotion motion = scene.Measure(0.01);
  const Vector3d w_I =
      scene.imu.T_g().inverse() * (scene.samples[0].gyro - scene.x.b_g);
  EXPECT_LT((motion.w_I - w_I).norm(), 1e-12);
  EXPECT_LT((Log(motion.turn) - 0.01 * w_I).norm(), 1e-12);
}

// The offset of a device at rest is unobservable, however often it is observed.
TEST(MeasureMotion, NoiseAloneIsNoRate) {
  RandomValues random(8);
  const ImuNoise noise;
  const double sigma = noise.gyro_noise_density * std::sqrt(200.0);
  double measured = 0;
  double noisy = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    std::vector<ImuSample> samples;
    for (std::int64_t i = 0; i < 40; ++i) {
      samples.push_back({i * kPeriod_ns,
                         random.Normal3(sigma),
                         Vector3d(0, 0, kMotionGravity)});
    }
    const KeyframeState x{.t_ns = 101'000'000};
    measured += MeasureMotion(samples, x, {}, noise, kMotionGravity, 0)
                    .w_I.squaredNorm();
    // Smoothed over six samples.
    noisy += 3 * sigma * sigma / 6;
  }
  EXPECT_LT(measured, 0.01 * noisy);
  EXPECT_GT(measured, 0);
}

TEST(MeasureMotion, IsTheSameAtAnyHeading) {
  RandomValues random(6);
  for (int trial = 0; trial < 100; ++trial) {
    const Scene scene(random);
    const double yaw = random.Uniform(-3, 3);
    const Eigen::Quaterniond turn = Exp(Vector3d(0, 0, yaw));
    KeyframeState turned = scene.x;
    turned.q_GI = turn * turned.q_GI;
    turned.v_GI = turn * turned.v_GI;
    const KeyframeMotion a = scene.Measure(0.02);
    const KeyframeMotion b = MeasureMotion(
        scene.samples, turned, scene.imu, {}, kMotionGravity, 0.02);
    EXPECT_LT((b.shift_I - a.shift_I).norm(), 1e-12);
    EXPECT_LT((b.v_I - a.v_I).norm(), 1e-12);
    EXPECT_LT((b.w_I - a.w_I).norm(), 1e-12);
  }
}

TEST(KeyframeMotions, AreOfTheCamerasThatNeedThem) {
  RandomValues random(7);
  const Scene scene(random);
  Calibration theta;
  theta.imu = scene.imu;
  for (int j = 0; j < 3; ++j) {
    theta.cameras.push_back(random.Camera(DistortionModel::kFov));
  }
  theta.cameras[2].time_offset_s = 0.01;
  const std::vector<KeyframeState> keyframes = {scene.x, scene.x};
  const auto samples = [&](std::size_t k) {
    return KeyframeContext{scene.samples, 10.0 * static_cast<double>(k)};
  };
  KeyframeMotions motions;
  const std::vector<char> second = {0, 1, 0};
  motions.Measure(Rig(), theta, second, keyframes, samples);
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(motions.At(k, 0), nullptr);
    ASSERT_NE(motions.At(k, 1), nullptr);
    EXPECT_EQ(motions.At(k, 1)->dt_s, 0);
    ASSERT_NE(motions.At(k, 2), nullptr);
    EXPECT_EQ(motions.At(k, 2)->dt_s, 0.01);
  }
  theta.cameras[2].time_drift = 1e-3;
  motions.Measure(Rig(), theta, second, keyframes, samples);
  EXPECT_EQ(motions.At(0, 2)->dt_s, 0.01);
  EXPECT_DOUBLE_EQ(motions.At(1, 2)->dt_s, 0.02);
  EXPECT_EQ(motions.At(1, 2)->session_s, 10);
  theta.cameras[2].time_drift.reset();
  theta.cameras[2].time_offset_s = 0;
  const std::vector<char> none = {0, 0, 0};
  motions.Measure(Rig(), theta, none, keyframes, samples);
  for (int j = 0; j < 3; ++j) EXPECT_EQ(motions.At(0, j), nullptr);
}

}  // namespace
}  // namespace selfcal
