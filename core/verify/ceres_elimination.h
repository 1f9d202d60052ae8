// The factors of a segment by Ceres, eliminated down to theta by CHOLMOD.
#pragma once

#include "core/information/inliers.h"
#include "core/information/linearisation.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// What SegmentLineariser::Eliminate computes. Throws std::runtime_error where
// that is not possible (scorer.h).
LinearisedSegment EliminateByCeres(const Rig& rig,
                                   const Calibration& theta0,
                                   const MotionSegment& segment,
                                   const InlierSelection& selection,
                                   int gauge_keyframe);

}  // namespace selfcal
