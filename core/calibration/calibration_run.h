// One calibration from start to end, on segments as they come: what Calibrate()
// goes through, once or more often, after it has looked at its input.
#pragma once

#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/evicted_fusion.h"
#include "core/calibration/segment_agreement.h"

namespace selfcal {

struct CalibrationRun {
  CalibrationResult result;
  // Of each segment; empty where no minimum was reached.
  std::vector<SegmentEvidence> evidence;
  DataEstimate estimate;  // what the result says; where there is evidence
};

// As Calibrate(), with segments in the order of their keys, all of which are
// used. They must outlive the call alone.
CalibrationRun RunCalibration(const Rig& rig,
                              const Calibration& theta_start,
                              const std::vector<const MotionSegment*>& segments,
                              const CalibrateOptions& options,
                              const ProgressCallback& progress);

}  // namespace selfcal
