// Ends of a segment, linearised at the states that minimise its residuals.
//
// States of a SLAM system may be far from their minimum: those of a filter that
// has lost the scale may be wrong by a third. Elimination takes one linear step
// from them, which is enough for a score; but information that is kept without
// the data can never be relinearised.
//
// Pure, callable from any thread, deterministic for one width of vectors.
#pragma once

#include "core/information/segment_ends.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Returns true if the linear minimum, with theta held constant, is further from
// the states at the ends than is usual for good states, measured by their
// velocities.
bool IsFarFromMinimum(const SegmentEnds& ends);

// Returns the segment with states and landmarks at their minimum, with theta
// held constant. Landmarks that are not determined stay in place; everything
// does if the states are not determined.
MotionSegment SettleSegment(const Rig& rig,
                            const Calibration& theta,
                            const MotionSegment& segment);

// Computes SummariseEnds() of the segment, or of the settled segment if
// IsFarFromMinimum(), which takes 30 times as long; from the start of
// FindOffsetStart(), if there is one. The segment must be valid for the rig.
SegmentEnds SummariseSettledEnds(const Rig& rig,
                                 const Calibration& theta0,
                                 const MotionSegment& segment);

}  // namespace selfcal
