// The information of a segment about theta and about the states of its first
// and its last keyframe, small enough to be kept when the data is gone.
//
// By themselves, segments do not know tilt, velocity and biases at their first
// keyframe, and what they say about theta alone (segment_information.h) does
// without what their neighbours know of these: summed over a session it claims
// sigmas of 1.05 to 1.6 times those of a calibration on all data. With both
// ends, neighbours can be joined later as if they were one segment
// (session_chain.h); what is left out then is that landmarks continue, which
// is worth 4 to 10 %.
//
// Pure functions, any thread, deterministic for one width of vectors.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Unknowns of the two states, 15 each.
inline constexpr int kEndUnknowns = 30;

struct SegmentEnds {
  SegmentKey key;
  // Where it was linearised.
  Calibration theta0;
  KeyframeState first, last;
  // Over D + kEndUnknowns: theta [-] theta0, then the offsets of both states.
  // Of the data alone; zero rows for components that the rig holds fixed.
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;
  // About and after the last keyframe: up to the first keyframe of the next
  // segment, where that follows directly.
  std::vector<ImuSample> tail;
};

// As ScoreSegment(), of the same inliers. The segment must be valid for the
// rig.
SegmentEnds SummariseEnds(const Rig& rig,
                          const Calibration& theta0,
                          const MotionSegment& segment,
                          const ScoreOptions& options = {});

}  // namespace selfcal
