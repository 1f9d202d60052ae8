// The posterior of theta by ceres::Covariance: what the structured elimination
// is checked against from a second side.
#pragma once

#include <Eigen/Core>

#include "core/verify/segment_problem.h"

namespace selfcal {

class CeresSegment {
 public:
  // As SegmentProblem.
  CeresSegment(const Rig& rig,
               const Calibration& theta0,
               const MotionSegment& segment,
               const InlierSelection& selection,
               int gauge_keyframe);

  // Posterior covariance of the free components of theta, in units of the
  // prior. Empty if Ceres finds the problem rank deficient.
  Eigen::MatrixXd Posterior();

  // Residuals and Jacobian of all factors, once; false if Ceres cannot.
  bool Evaluate();

 private:
  SegmentProblem problem_;
};

}  // namespace selfcal
