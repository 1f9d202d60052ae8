// Individual residuals of a segment as its score uses them, for a person who
// looks for large ones. States are those of the SLAM system, landmarks those of
// InlierSelection; nothing is estimated.
//
// Pure, callable from any thread, deterministic for one width of vectors.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/factor/inertial.h"
#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct ObservationResidual {
  bool projects = false;  // otherwise there is no residual
  bool inlier = false;    // used in a score
  Eigen::Vector2d residual_px =
      Eigen::Vector2d::Zero();  // predicted - measured
};

// Residual between consecutive keyframes. Parts as in EvaluateInertial:
// rotation [rad], velocity [m/s], position [m], steps of the biases [m/s^2],
// [rad/s].
struct IntervalResidual {
  InertialResidual residual;
  InertialResidual whitened;  // in standard deviations, without correlations
};

struct SegmentResiduals {
  std::vector<ObservationResidual> observations;  // as in the segment
  std::vector<IntervalResidual> intervals;        // of the first IMU
  // Those of the second IMU, with the velocity and biases that StartSecondImu
  // gives it; empty without one.
  std::vector<IntervalResidual> second_intervals;
  ResidualStatistics statistics;  // as in a score
};

// The segment must be valid for the rig, and theta must have the shape of the
// factory calibration.
SegmentResiduals EvaluateResiduals(const Rig& rig,
                                   const Calibration& theta,
                                   const MotionSegment& segment,
                                   const ScoreOptions& options = {});

}  // namespace selfcal
