// The motion of a device without a SLAM system: states and landmarks of a
// segment from its tracks and readings, with theta held constant.
//
// AlignMotion gives the start; the solver of a calibration moves states and
// landmarks to their joint minimum, with its robust weights and its selection
// of tracks. The result is what a SLAM system with this theta would estimate
// without a map, and a segment as the daemon takes it.
//
// Pure, callable from any thread; takes some hundred milliseconds for 40
// keyframes with 200 tracks.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/motion/alignment.h"

namespace selfcal {

struct MotionEstimate {
  // Empty if the motion was found; else why not, as a clause ("the tracks do
  // not agree with one motion of the device").
  std::string failure;
  int observations = 0;            // of the segment
  int used = 0;                    // of these, in the estimate
  int landmarks = 0;               // used
  double reprojection_rms_px = 0;  // of the used observations
};

// Sets the states and positions of landmarks of a segment, of which only times,
// readings, and observations are used; if it fails, they have no meaning. The
// readings should extend as those of MotionSegment::imu. An observation of a
// landmark that is not used remains in the segment.
MotionEstimate EstimateMotion(const Rig& rig,
                              const Calibration& theta,
                              const MotionStart& start,
                              MotionSegment* segment);

// The state at a later time by the readings, with the biases of x: the start of
// the segment that follows.
KeyframeState CarryOn(const Rig& rig,
                      const Calibration& theta,
                      const KeyframeState& x,
                      std::span<const ImuSample> samples,
                      std::int64_t t_ns);

}  // namespace selfcal
