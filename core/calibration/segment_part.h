// One segment of a calibration by itself: what the calibration uses of it, and
// the information of that about theta.
//
// Pure, callable from any thread, deterministic.
#pragma once

#include "core/calibration/working_point.h"
#include "core/elimination/chain_elimination.h"

namespace selfcal {

// The keyframes [first, first + count) of a problem, which are those of one
// segment.
struct KeyframeRange {
  int first = 0;
  int count = 0;

  bool Contains(int keyframe) const {
    return keyframe >= first && keyframe < first + count;
  }
};

struct SegmentPart {
  // Information about the tangent of theta, prior not included, with the states
  // and landmarks of the segment as unknowns of its own. Lambda is the
  // covariance of eta: a robust loss takes influence from large residuals, and
  // eta as the sum of what is left varies less than the weights say. It is zero
  // if the states are not determined.
  SharedInformation theta;
  double reprojection_rms_px = 0;  // of the used observations
  // Root of the mean over inertial links of the squared whitened residuals.
  double inertial_rms = 0;
};

// Linearises the part of a calibration that belongs to one segment at its
// estimate, with the weights that the calibration gives to the observations.
// Landmarks with fewer than two of them in the segment are left out.
SegmentPart LineariseSegmentPart(const WorkingPoint& point,
                                 const KeyframeRange& range);

}  // namespace selfcal
