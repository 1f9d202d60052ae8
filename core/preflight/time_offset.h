// The time offset between the stamps of keyframes and the clock of the IMU, by
// correlation: the offset at which the gyroscope's rotations between keyframes
// are those of their states. It needs no start: a coarse search over all
// offsets finds one for Gauss-Newton steps.
//
// The states of a SLAM system that assumes a wrong offset of its camera are
// those at the exposures, at times that are wrong by the error of the offset.
// The offset that is found is that error.
//
// Pure, deterministic, callable from any thread. Segments need not be valid.
#pragma once

#include <optional>
#include <span>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Range of the offset [s], of either sign. Segments need samples for that time
// before their first and after their last keyframe (kImuPadding_s), or the
// intervals at their ends are not used.
inline constexpr double kMaxTimeOffset_s = 0.15;

struct TimeOffset {
  double offset_s = 0;  // the states hold this much later than their stamps
  double sigma_s = 0;   // of the fit: from the residuals of the rotations
};

// `theta` is the calibration that the SLAM system used; only its IMU matters.
// The error is at most 2 ms, by which SLAM systems with a factory calibration
// err, and 6 sigma. nullopt if the offset is not determined: there are less
// than 10 intervals of keyframes or they hardly turn, sigma is above 1 ms, the
// rates do not fit the rotations at any offset (CheckGyro finds why), or the
// offset is outside the range.
std::optional<TimeOffset> EstimateTimeOffset(
    const Calibration& theta, std::span<const MotionSegment> segments);

// Smaller offsets [s] do no harm that a recalibration could not correct, and
// look like a SLAM system's own delays.
inline constexpr double kLeastTimeOffset_s = 5e-3;

// Returns whether a calibration explains states that hold this much later than
// their stamps, about this time after the session began: those of the IMU's
// clock, or of the first or the middle row of the images of a camera.
bool IsStatedOffset(const Calibration& theta,
                    double session_s,
                    double offset_s,
                    double tolerance_s);

}  // namespace selfcal
