#include "core/preflight/time_offset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include "core/simulation/simulate.h"
#include "test/core/simulation/rigs.h"
#include "test/promise.h"

namespace selfcal {
namespace {

// The error that the header states, beside 6 sigma.
constexpr double kTimeOffsetError_s = 2e-3;

// Segments of a SLAM system with a factory calibration, that assumes no time
// offset where there is one.
std::vector<MotionSegment> Segments(double offset_s,
                                    const Trajectory& trajectory,
                                    std::uint64_t seed) {
  const Rig rig = HandheldRig("a");
  Calibration truth = rig.factory;
  truth.cameras[0].time_offset_s = offset_s;
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 20;
  return Simulate(rig,
                  truth,
                  PerturbCalibration(rig.factory, {}, seed),
                  trajectory,
                  "s",
                  options)
      .segments;
}

double Bound(const TimeOffset& found) {
  return kTimeOffsetError_s + 6 * found.sigma_s;
}

TEST(EstimateTimeOffset, IsWithinTheStatedErrorOverMotions) {
  const Calibration theta = HandheldRig("a").factory;
  const int seeds = Trials(5);
  double worst_s = 0, largest_bound_s = 0;
  int found_count = 0;
  for (const double offset_s : {-0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1}) {
    for (const double vigour : {1.0, 0.3}) {
      for (int seed = 1; seed <= seeds; ++seed) {
        const auto segments =
            Segments(offset_s, *MakeHandheld(9, vigour, seed), seed);
        ASSERT_FALSE(segments.empty());
        const auto found = EstimateTimeOffset(theta, segments);
        if (vigour == 1.0) {
          EXPECT_TRUE(found.has_value()) << offset_s << ", seed " << seed;
        }
        if (!found) continue;
        ++found_count;
        const double error_s = std::abs(found->offset_s - offset_s);
        worst_s = std::max(worst_s, error_s);
        largest_bound_s = std::max(largest_bound_s, Bound(*found));
        EXPECT_LT(error_s, Bound(*found))
            << offset_s << ", vigour " << vigour << ", seed " << seed;
      }
    }
  }
  std::printf("%d offsets, largest error %.2f ms, largest bound %.2f ms\n",
              found_count,
              1e3 * worst_s,
              1e3 * largest_bound_s);
}

// One segment of four seconds is enough.
TEST(EstimateTimeOffset, NeedsOneSegmentOfVigorousMotion) {
  const Calibration theta = HandheldRig("a").factory;
  for (int seed = 1; seed <= 5; ++seed) {
    const auto segments = Segments(0.08, *MakeHandheld(9, 1, seed), seed);
    for (const MotionSegment& segment : segments) {
      const auto found = EstimateTimeOffset(theta, std::span(&segment, 1));
      ASSERT_TRUE(found.has_value()) << seed;
      EXPECT_LT(std::abs(found->offset_s - 0.08), Bound(*found));
    }
  }
}

TEST(EstimateTimeOffset, IsNotDeterminedAtRest) {
  const Calibration theta = HandheldRig("a").factory;
  for (int seed = 1; seed <= 5; ++seed) {
    EXPECT_FALSE(EstimateTimeOffset(theta, Segments(0.05, *MakeRest(9), seed)));
  }
}

// A constant rate looks the same at any time.
TEST(EstimateTimeOffset, IsNotDeterminedWhereRotationIsTooWeakOrSteady) {
  const Calibration theta = HandheldRig("a").factory;
  int determined = 0;
  for (int seed = 1; seed <= 5; ++seed) {
    for (const double vigour : {0.01, 0.03}) {
      determined +=
          EstimateTimeOffset(
              theta, Segments(0.05, *MakeHandheld(9, vigour, seed), seed))
              .has_value();
    }
  }
  EXPECT_EQ(determined, 0);
  MotionSegment steady;
  const Eigen::Vector3d w(0, 0, 0.8);
  for (int k = 0; k < 100; ++k) {
    KeyframeState x;
    x.t_ns = k * 100'000'000ll;
    // Errors of a SLAM system, that are larger than any trace of an offset.
    x.q_GI = Eigen::AngleAxisd(0.08 * k + 1e-3 * std::sin(37.0 * k),
                               Eigen::Vector3d::UnitZ());
    steady.keyframes.push_back(x);
  }
  for (int i = -40; i < 2040; ++i) {
    steady.imu.push_back({i * 5'000'000ll, w, {0, 0, 9.81}});
  }
  EXPECT_FALSE(EstimateTimeOffset(theta, std::span(&steady, 1)));
}

// Data of a wrong unit fits at no offset.
TEST(EstimateTimeOffset, IsNotDeterminedOfRatesThatDoNotFit) {
  const Calibration theta = HandheldRig("a").factory;
  auto segments = Segments(0.02, *MakeHandheld(9, 1, 1), 1);
  for (MotionSegment& segment : segments) {
    for (ImuSample& sample : segment.imu) {
      sample.gyro = {sample.gyro.y(), -sample.gyro.x(), sample.gyro.z()};
    }
  }
  EXPECT_FALSE(EstimateTimeOffset(theta, segments));
  EXPECT_FALSE(EstimateTimeOffset(theta, {}));
}

}  // namespace
}  // namespace selfcal
