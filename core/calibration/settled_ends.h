// Ends of a segment, linearised where the data has its states.
//
// States of a SLAM system may lie far from their minimum: a filter that has
// lost the scale is off by a third. Elimination takes one linear step from
// there, which is enough for a score; but what is kept without the data can
// never be linearised again.
//
// Pure, any thread, deterministic for one width of vectors.
#pragma once

#include "core/information/segment_ends.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Whether the linear minimum, with theta held, is further from the states at
// the ends than sound ones are: by their velocities.
bool IsFarFromMinimum(const SegmentEnds& ends);

// The segment with states and landmarks at their minimum, theta held. Landmarks
// that are not determined stay where they are; so does all, where the states
// are not determined.
MotionSegment SettleSegment(const Rig& rig,
                            const Calibration& theta,
                            const MotionSegment& segment);

// SummariseEnds(), of the settled segment where that IsFarFromMinimum(): that
// takes 30 times as long. The segment must be valid for the rig.
SegmentEnds SummariseSettledEnds(const Rig& rig,
                                 const Calibration& theta0,
                                 const MotionSegment& segment);

}  // namespace selfcal
