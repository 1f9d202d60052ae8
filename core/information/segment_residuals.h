// The residuals of a segment one by one, as its score takes them: what a person
// looks at to see which of them are large. States are those of the SLAM system,
// landmarks those of InlierSelection; nothing is calibrated.
//
// Pure, any thread, deterministic for one width of vectors.
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
  bool projects = false;  // else there is no residual
  bool inlier = false;    // used in a score
  Eigen::Vector2d residual_px =
      Eigen::Vector2d::Zero();  // predicted - measured
};

// Between a keyframe and the next. Parts as EvaluateInertial has them: rotation
// [rad], velocity [m/s], position [m], steps of the biases [m/s^2], [rad/s].
struct IntervalResidual {
  InertialResidual residual;
  InertialResidual whitened;  // in standard deviations, without correlations
};

struct SegmentResiduals {
  std::vector<ObservationResidual> observations;  // as in the segment
  std::vector<IntervalResidual> intervals;
  ResidualStatistics statistics;  // as of a score
};

// The segment must be valid for the rig, and theta have the shape of the
// factory's calibration.
SegmentResiduals EvaluateResiduals(const Rig& rig,
                                   const Calibration& theta,
                                   const MotionSegment& segment,
                                   const ScoreOptions& options = {});

}  // namespace selfcal
