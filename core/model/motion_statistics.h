// Statistics of the motion in a segment: figures to find and compare segments
// by. No estimate uses them.
#pragma once

#include "core/model/segment.h"

namespace selfcal {

struct MotionStatistics {
  // Root mean square of the norm of the readings of the gyroscope between the
  // first and the last keyframe, less the mean bias of the keyframes. Scales
  // and misalignments are not corrected.
  double angular_rate_radps = 0;
  // Root mean square over time of the norm of the acceleration of the body in
  // G: the differences of the velocities of neighbouring keyframes divided by
  // the time between them. Gravity is not part of it.
  double acceleration_mps2 = 0;

  friend bool operator==(const MotionStatistics&,
                         const MotionStatistics&) = default;
};

// The segment must be valid (Validate in segment.h): its statistics are then
// finite.
MotionStatistics MotionStatisticsOf(const MotionSegment& segment);

}  // namespace selfcal
