#include "test/core/information/unknown_offset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

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

}  // namespace
}  // namespace selfcal
