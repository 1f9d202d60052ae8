#include "core/calibration/absent_effects.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/noise_scale.h"
#include "core/calibration/remembered_segment.h"
#include "core/calibration/settled_ends.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

using Change = std::function<void(Calibration*)>;

struct Device {
  Rig rig;  // with the noise that the calibration was weighted with
  CalibrationResult result;
  std::vector<MotionSegment> segments;
};

// A hand-held device is calibrated as if its truth had no such effect.
Device CalibrateDevice(const Change& effect,
                       std::uint64_t seed,
                       const std::vector<BlockSetting>& blocks = {},
                       double duration_s = 17) {
  Device device;
  Rig& rig = device.rig;
  rig = HandheldRig("effects");
  rig.blocks = blocks;
  const Calibration rest = rig.factory;
  Calibration truth = rest;
  effect(&truth);
  rig.factory = PerturbCalibration(rest, {}, seed);
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  SimulationOptions options;
  options.seed = seed;
  options.keyframes_per_segment = 20;
  options.landmarks_in_view = 60;
  device.segments = Simulate(rig,
                             truth,
                             rig.factory,
                             *MakeHandheld(duration_s, 1, seed),
                             "session",
                             options)
                        .segments;
  device.result = Calibrate(rig, rig.factory, device.segments);
  EXPECT_EQ(device.result.status, CalibrateStatus::kConverged)
      << device.result.message;
  for (const NoiseScale& scale : device.result.noise_scales) {
    ScaleNoise(scale.kind, scale.used, &rig);
  }
  return device;
}

// The same device with the data of the first `kept` segments, remembering the
// others.
Device Remembering(Device device, std::size_t kept) {
  std::vector<RememberedSegment> remembered;
  for (std::size_t s = 0; s < device.segments.size(); ++s) {
    const MotionSegment& segment = device.segments[s];
    RememberedSegment& one = remembered.emplace_back();
    one.key = segment.key;
    one.time_ns = segment.keyframes.front().t_ns;
    if (s < kept) continue;
    one.ends = SummariseSettledEnds(device.rig, device.result.theta, segment);
  }
  device.segments.resize(kept);
  CalibrateOptions options;
  options.remembered = remembered;
  device.result =
      Calibrate(device.rig, device.rig.factory, device.segments, options);
  EXPECT_EQ(device.result.status, CalibrateStatus::kConverged)
      << device.result.message;
  EXPECT_EQ(device.result.remembered.segments,
            static_cast<int>(remembered.size() - kept))
      << device.result.remembered.unused;
  return device;
}

std::vector<AbsentEffect> EffectsOf(const Device& device) {
  const bool completed = device.result.covariance_of_data.size() > 0;
  return TestAbsentEffects(
      device.rig,
      {device.result.theta,
       device.result.covariance,
       device.result.track_noise_factor},
      completed ? device.result.covariance_of_data : device.result.covariance,
      device.segments);
}

std::vector<std::string> BlocksOf(const std::vector<AbsentEffect>& effects) {
  std::vector<std::string> blocks;
  for (const AbsentEffect& effect : effects) blocks.push_back(effect.block);
  return blocks;
}

AbsentEffect MostLikely(const std::vector<AbsentEffect>& effects) {
  return *std::max_element(
      effects.begin(), effects.end(), [](const auto& a, const auto& b) {
        return a.test.statistic / a.test.degrees <
               b.test.statistic / b.test.degrees;
      });
}

void NoEffect(Calibration*) {}

void MoveAxesApart(Calibration* truth) {
  truth->imu.accel_position.resize(9);
  truth->imu.accel_position << -0.01, 0.005, -0.005, 0.015, -0.01, 0, -0.005,
      0.005, 0.005;
}

TEST(AbsentEffects, WithoutAnyTheStatisticIsThatOfChance) {
  double statistic = 0;
  int degrees = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    for (const AbsentEffect& effect :
         EffectsOf(CalibrateDevice(NoEffect, seed))) {
      EXPECT_GT(effect.test.probability, 1e-4) << effect.block;
      EXPECT_LT(effect.bias_sigmas, 1) << effect.block << " " << seed;
      statistic += effect.test.statistic;
      degrees += effect.test.degrees;
    }
  }
  std::printf("%.1f of %d\n", statistic, degrees);
  // 17 degrees of each device; 99.9 % of the chi-square distribution.
  EXPECT_EQ(degrees, 12 * 17);
  EXPECT_NEAR(statistic, degrees, 3.3 * std::sqrt(2.0 * degrees));
}

TEST(AbsentEffects, AreThoseThatTheRigDoesNotEstimate) {
  const Device device = CalibrateDevice(NoEffect, 1);
  EXPECT_EQ(BlocksOf(EffectsOf(device)),
            (std::vector<std::string>{"imu.gyro.g_sensitivity",
                                      "imu.accel.position",
                                      "cam0.time_offset",
                                      "cam0.line_delay"}));
  const Device estimates = CalibrateDevice(
      [](Calibration* truth) { truth->cameras[0].time_offset_s = 2e-3; },
      1,
      {{"*.time_offset", true}});
  const std::vector<AbsentEffect> others = EffectsOf(estimates);
  EXPECT_EQ(
      BlocksOf(others),
      (std::vector<std::string>{
          "imu.gyro.g_sensitivity", "imu.accel.position", "cam0.line_delay"}));
  for (const AbsentEffect& effect : others) {
    EXPECT_GT(effect.test.probability, 1e-4) << effect.block;
  }
  Device fixed = device;
  fixed.rig.fixed = {"cam0.time_offset", "imu.accel.position.*"};
  EXPECT_EQ(
      BlocksOf(EffectsOf(fixed)),
      (std::vector<std::string>{"imu.gyro.g_sensitivity", "cam0.line_delay"}));
  EXPECT_TRUE(TestAbsentEffects(device.rig,
                                {device.result.theta, device.result.covariance},
                                device.result.covariance,
                                {})
                  .empty());
}

struct EffectCase {
  std::string block;
  Change change;
};

class EachEffect : public testing::TestWithParam<EffectCase> {};

// The shift is the difference from what the same device gives without it.
TEST_P(EachEffect, IsFoundWithItsShiftWithinAFactorOfTwo) {
  for (const std::uint64_t seed : {1, 2}) {
    const Device without = CalibrateDevice(NoEffect, seed);
    const Device device = CalibrateDevice(GetParam().change, seed);
    const AbsentEffect found = MostLikely(EffectsOf(device));
    EXPECT_EQ(found.block, GetParam().block);
    EXPECT_LT(found.test.probability, 1e-6);
    const int i = MatchComponents(TangentComponents(device.rig.factory),
                                  {found.component})
                      .at(0);
    const double shift =
        std::abs(BoxMinus(device.result.theta, without.result.theta)(i)) /
        std::sqrt(device.result.covariance(i, i));
    std::printf("%s: %.1f of %d, %s %.2f sigma, shifted by %.2f\n",
                found.block.c_str(),
                found.test.statistic,
                found.test.degrees,
                found.component.c_str(),
                found.bias_sigmas,
                shift);
    EXPECT_GT(found.bias_sigmas, shift / 2);
    EXPECT_LT(found.bias_sigmas, 2 * shift + 0.5);
  }
}

// The positions of the axes are found to shift theta by as much as they do.
void ExpectBias(const Device& device, const Device& without) {
  const AbsentEffect found = MostLikely(EffectsOf(device));
  EXPECT_EQ(found.block, "imu.accel.position");
  const double shift =
      BoxMinus(device.result.theta, without.result.theta)
          .cwiseQuotient(
              device.result.covariance.diagonal().cwiseSqrt().cwiseMax(1e-12))
          .cwiseAbs()
          .maxCoeff();
  std::printf("%s %.2f sigma, shifted by at most %.2f\n",
              found.component.c_str(),
              found.bias_sigmas,
              shift);
  EXPECT_GT(found.bias_sigmas, shift / 2);
  EXPECT_LT(found.bias_sigmas, 3 * shift);
}

// An effect shifts a calibration furthest where the motion shows it least.
TEST(AbsentEffects, AreNotTooSmallInFewSegments) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Device without = CalibrateDevice(NoEffect, seed, {}, 8);
    const Device device = CalibrateDevice(MoveAxesApart, seed, {}, 8);
    ExpectBias(device, without);
  }
}

// Segments without data make theta more certain, and show the same effect.
TEST(AbsentEffects, AreNotTooSmallBesideRememberedSegments) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Device without =
        Remembering(CalibrateDevice(NoEffect, seed, {}, 33), 4);
    const Device device =
        Remembering(CalibrateDevice(MoveAxesApart, seed, {}, 33), 4);
    ExpectBias(device, without);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All,
    EachEffect,
    testing::Values(EffectCase{"imu.gyro.g_sensitivity",
                               [](Calibration* truth) {
                                 truth->imu.gyro_g_sensitivity.resize(9);
                                 truth->imu.gyro_g_sensitivity << 5e-4, -3e-4,
                                     2e-4, 1e-4, -4e-4, 3e-4, -2e-4, 5e-4, 4e-4;
                               }},
                    EffectCase{"imu.accel.position", MoveAxesApart},
                    EffectCase{"cam0.time_offset",
                               [](Calibration* truth) {
                                 truth->cameras[0].time_offset_s = 5e-4;
                               }},
                    EffectCase{"cam0.line_delay",
                               [](Calibration* truth) {
                                 truth->cameras[0].line_delay_s =
                                     2e-3 / truth->cameras[0].height_px;
                               }}),
    [](const auto& info) {
      std::string name = info.param.block;
      std::replace(name.begin(), name.end(), '.', '_');
      return name;
    });

}  // namespace
}  // namespace selfcal
