#include "test/core/information/unknown_offset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"

namespace selfcal {
namespace {

// End to end: of an offset that the factory does not state, from segments of a
// SLAM system that does not know it.
TEST(Calibrate, FindsATimeOffsetThatNobodyKnows) {
  for (const double offset_s : {0.02, 0.05, 0.1, -0.1}) {
    const DeviceOfUnknownOffset device = WithOffset(offset_s, 5);
    const CalibrationResult result =
        Calibrate(device.rig, device.rig.factory, device.session.segments, {});
    ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
    const int at = TimeOffsetComponent(device.rig.factory, 0);
    const double sigma_s = std::sqrt(result.covariance(at, at));
    const double error_s = result.theta.cameras[0].time_offset_s - offset_s;
    std::printf("offset %.0f ms: error %.3f ms, sigma %.3f ms\n",
                1e3 * offset_s,
                1e3 * error_s,
                1e3 * sigma_s);
    EXPECT_LT(std::abs(error_s), 4 * sigma_s);
    EXPECT_LT(sigma_s, 1e-3);
    for (const SegmentFit& fit : result.segment_fits) {
      EXPECT_EQ(fit.excluded, "");
    }
    EXPECT_LT(result.reprojection_rms_after_px, 1.6);
  }
}

// A value that is not estimated stays as it is stated.
TEST(Calibrate, ADriftThatIsHeldIsNotMoved) {
  constexpr double kDrift = 1e-6;
  DeviceOfUnknownOffset device = WithOffset(0.05, 5);
  Rig& rig = device.rig;
  rig.blocks = {{"*.time_offset", true}, {"*.time_drift", false}};
  std::vector<MotionSegment> segments = device.session.segments;
  rig.factory.cameras[0].time_drift = kDrift;
  // Each is a minute after the one before: the shifts differ by their errors.
  for (std::size_t s = 0; s < segments.size(); ++s) {
    segments[s].key.session = "s" + std::to_string(s);
    segments[s].session_start_ns =
        segments[s].keyframes.front().t_ns -
        static_cast<std::int64_t>(s) * 60'000'000'000;
  }
  const CalibrationResult result = Calibrate(rig, rig.factory, segments, {});
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  EXPECT_EQ(result.theta.cameras[0].time_drift, kDrift);
}

// One segment of another clock does not move that of all others.
TEST(Calibrate, AFewSegmentsOfAnotherClockAreExcluded) {
  const DeviceOfUnknownOffset device = WithOffset(0, 5);
  std::vector<MotionSegment> segments = device.session.segments;
  for (MotionSegment segment : WithOffset(0, 6).session.segments) {
    segment.key.session = "t";
    segments.push_back(segment);
  }
  ASSERT_EQ(segments.size(), 6u);
  segments[1] = WithOffset(0.1, 5).session.segments[1];
  const CalibrationResult result =
      Calibrate(device.rig, device.rig.factory, segments, {});
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  const int at = TimeOffsetComponent(device.rig.factory, 0);
  const double sigma_s = std::sqrt(result.covariance(at, at));
  EXPECT_LT(std::abs(result.theta.cameras[0].time_offset_s), 4 * sigma_s);
  EXPECT_LT(sigma_s, 1e-3);
  for (std::size_t s = 0; s < segments.size(); ++s) {
    EXPECT_EQ(result.segment_fits[s].excluded.empty(), s != 1)
        << s << " " << result.segment_fits[s].excluded;
  }
}

}  // namespace
}  // namespace selfcal
