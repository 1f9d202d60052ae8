// The posterior of theta by ceres::Covariance on the same segment, built from
// the Ceres factors: what the structured elimination is checked against from a
// second side.
#pragma once

#include <Eigen/Core>

#include "core/information/inliers.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Posterior covariance of the free components of theta, in units of the prior,
// with the prior of the rig and the weak priors. Empty if Ceres finds the
// problem rank deficient.
Eigen::MatrixXd CeresPosterior(const Rig& rig,
                               const Calibration& theta0,
                               const MotionSegment& segment,
                               const InlierSelection& selection,
                               int gauge_keyframe);

}  // namespace selfcal
