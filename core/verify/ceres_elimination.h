// Evaluates the factors of a segment with Ceres and eliminates them down to
// theta with CHOLMOD.
#pragma once

#include "core/information/inliers.h"
#include "core/information/linearisation.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Computes the result of SegmentLineariser::Eliminate. Throws
// std::runtime_error if that is not possible (scorer.h).
LinearisedSegment EliminateByCeres(const Rig& rig,
                                   const Calibration& theta0,
                                   const MotionSegment& segment,
                                   const InlierSelection& selection,
                                   int gauge_keyframe);

}  // namespace selfcal
