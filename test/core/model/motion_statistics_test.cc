// Motions whose statistics have a closed form.
#include "core/model/motion_statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <numbers>
#include <utility>

namespace selfcal {
namespace {

constexpr double kTolerance = 1e-9;
constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kStep_ns = kSecond_ns / 200;  // of the samples

using VectorOfTime = std::function<Eigen::Vector3d(double)>;

// Four seconds with keyframes at 10 Hz, and samples that begin 0.15 s before
// the first and end 0.15 s after the last.
MotionSegment SegmentOf(const VectorOfTime& velocity,
                        const VectorOfTime& gyro) {
  MotionSegment segment;
  for (int k = 0; k <= 40; ++k) {
    KeyframeState& x = segment.keyframes.emplace_back();
    x.t_ns = k * kSecond_ns / 10;
    x.v_GI = velocity(0.1 * k);
  }
  for (int k = -30; k <= 830; ++k) {
    ImuSample& sample = segment.imu.emplace_back();
    sample.t_ns = k * kStep_ns;
    sample.gyro = gyro(1e-9 * static_cast<double>(sample.t_ns));
    sample.accel = {0, 0, 9.81};
  }
  return segment;
}

VectorOfTime Constant(const Eigen::Vector3d& value) {
  return [value](double) { return value; };
}

TEST(MotionStatistics, OfARestingDeviceAreZero) {
  const MotionSegment segment = SegmentOf(Constant(Eigen::Vector3d::Zero()),
                                          Constant(Eigen::Vector3d::Zero()));
  EXPECT_EQ(MotionStatisticsOf(segment), MotionStatistics());
}

TEST(MotionStatistics, OfAConstantRotationAreItsRateWithoutTheBias) {
  const Eigen::Vector3d bias{0.01, -0.02, 0.03};
  const Eigen::Vector3d rate{0.3, -0.4, 1.2};  // of norm 1.3
  MotionSegment segment =
      SegmentOf(Constant(Eigen::Vector3d::Zero()), Constant(rate + bias));
  for (std::size_t k = 0; k < segment.keyframes.size(); ++k) {
    // The mean is the bias.
    const double walk = 1e-3 * (static_cast<double>(k) - 20);
    segment.keyframes[k].b_g = bias + Eigen::Vector3d{walk, -walk, 2 * walk};
  }
  EXPECT_NEAR(MotionStatisticsOf(segment).angular_rate_radps, 1.3, kTolerance);
  EXPECT_EQ(MotionStatisticsOf(segment).acceleration_mps2, 0);
}

TEST(MotionStatistics, OfASwingAreTheRootMeanSquareOfItsRate) {
  // Two whole periods: the mean of the square of a sine is a half, and one
  // sample more, at which the sine is zero.
  const MotionSegment segment =
      SegmentOf(Constant(Eigen::Vector3d::Zero()), [](double t) {
        return Eigen::Vector3d{0, 3 * std::sin(std::numbers::pi * t), 0};
      });
  EXPECT_NEAR(MotionStatisticsOf(segment).angular_rate_radps,
              3 * std::sqrt(400.0 / 801),
              kTolerance);
}

TEST(MotionStatistics, AreThoseBetweenTheFirstAndTheLastKeyframe) {
  const MotionSegment segment =
      SegmentOf(Constant(Eigen::Vector3d::Zero()), [](double t) {
        const bool is_padding = t < -1e-6 || t > 4 + 1e-6;
        return Eigen::Vector3d{is_padding ? 100.0 : 2.0, 0, 0};
      });
  EXPECT_NEAR(MotionStatisticsOf(segment).angular_rate_radps, 2, kTolerance);
}

TEST(MotionStatistics, OfACircleAreSpeedSquaredOverRadius) {
  // The difference of two velocities is the chord of an arc of the circle of
  // velocities.
  constexpr double kSpeed = 2;
  constexpr double kRadius = 0.5;
  constexpr double kRate = kSpeed / kRadius;
  const MotionSegment segment = SegmentOf(
      [](double t) {
        return Eigen::Vector3d{
            kSpeed * std::cos(kRate * t), kSpeed * std::sin(kRate * t), 0};
      },
      Constant({0, 0, kRate}));
  const MotionStatistics found = MotionStatisticsOf(segment);
  const double chord = 2 * kSpeed * std::sin(0.1 * kRate / 2);
  EXPECT_NEAR(found.acceleration_mps2, chord / 0.1, kTolerance);
  EXPECT_NEAR(found.acceleration_mps2, kSpeed * kSpeed / kRadius, 0.06);
  EXPECT_NEAR(found.angular_rate_radps, kRate, kTolerance);
}

TEST(MotionStatistics, CountEachIntervalByItsLength) {
  MotionSegment segment;
  for (const auto& [second, speed] :
       {std::pair{0, 0.0}, std::pair{1, 6.0}, std::pair{4, 6.0}}) {
    KeyframeState& x = segment.keyframes.emplace_back();
    x.t_ns = second * kSecond_ns;
    x.v_GI = {speed, 0, 0};
    segment.imu.push_back({.t_ns = x.t_ns});
  }
  // 6 m/s^2 for one of four seconds.
  EXPECT_NEAR(MotionStatisticsOf(segment).acceleration_mps2, 3, kTolerance);
}

}  // namespace
}  // namespace selfcal
