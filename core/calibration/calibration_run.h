// One calibration from start to end, with the noise that the rig states: what
// Calibrate() goes through, once or more often, after it has looked at its
// input.
#pragma once

#include <vector>

#include "core/calibration/calibrate.h"

namespace selfcal {

// As Calibrate(), with segments in the order of their keys. Noise factors are
// estimated, nothing is weighted by them.
CalibrationResult RunCalibration(
    const Rig& rig,
    const Calibration& theta_start,
    const std::vector<const MotionSegment*>& segments,
    const CalibrateOptions& options,
    const ProgressCallback& progress);

}  // namespace selfcal
