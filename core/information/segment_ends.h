// The information of a segment about theta and the states of its first and last
// keyframe, small enough to be kept when the data is gone.
//
// A single segment does not observe tilt, velocity and biases at its first
// keyframe. Its information about theta alone (segment_information.h) lacks
// what its neighbours know about these states: the sum over a session gives
// sigmas of 1.05 to 1.6 times those of a calibration on all data. With both
// ends, neighbours can be joined later as if they were one segment
// (session_chain.h); this neglects only that landmarks continue from one to the
// next, which is worth 4 to 10 %. The motion of a second IMU is not part of an
// end: neighbours are joined by the readings of the first one alone.
//
// Pure functions, callable from any thread, deterministic for one width of
// vectors.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Dimension of the two states, 15 each.
inline constexpr int kEndUnknowns = 30;

struct SegmentEnds {
  SegmentKey key;
  // Linearisation point.
  Calibration theta0;
  double temperature_c = 0;  // of the segment
  KeyframeState first, last;
  // Information about D + kEndUnknowns: theta [-] theta0, then the offsets of
  // both states. It is that of the data alone; rows of components that the rig
  // holds fixed are zero.
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;
  // Samples about and after the last keyframe: up to the first keyframe of the
  // next segment, if that follows directly.
  std::vector<ImuSample> tail;
};

// Computes the ends of a segment from the same inliers as ScoreSegment(). The
// segment must be valid for the rig.
SegmentEnds SummariseEnds(const Rig& rig,
                          const Calibration& theta0,
                          const MotionSegment& segment,
                          const ScoreOptions& options = {});

}  // namespace selfcal
