// One complete calibration on a fixed set of segments. Calibrate() calls it
// once or several times, after it has checked its input.
#pragma once

#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/remembered_fusion.h"
#include "core/calibration/segment_agreement.h"

namespace selfcal {

struct CalibrationRun {
  CalibrationResult result;
  // One for each segment; empty if no minimum was reached.
  std::vector<SegmentEvidence> evidence;
  DataEstimate estimate;  // in the form that FuseRemembered needs; set if there
                          // is evidence
};

// Same as Calibrate(), with segments in the order of their keys, all of which
// are used. They must outlive only the call.
CalibrationRun RunCalibration(const Rig& rig,
                              const Calibration& theta_start,
                              const std::vector<const MotionSegment*>& segments,
                              const CalibrateOptions& options,
                              const ProgressCallback& progress);

}  // namespace selfcal
