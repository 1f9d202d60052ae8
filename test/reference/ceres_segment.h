// One segment as a ceres::Problem built from the Ceres factors, and the
// posterior of theta by ceres::Covariance on it: what the structured
// elimination is checked against from a second side.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "core/information/inliers.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// With the prior of the rig and the weak priors. What it is made from must
// outlive it.
class CeresSegment {
 public:
  CeresSegment(const Rig& rig,
               const Calibration& theta0,
               const MotionSegment& segment,
               const InlierSelection& selection,
               int gauge_keyframe);
  ~CeresSegment();

  // Posterior covariance of the free components of theta, in units of the
  // prior. Empty if Ceres finds the problem rank deficient.
  Eigen::MatrixXd Posterior();

  // Residuals and Jacobian of all factors, once; false if Ceres cannot.
  bool Evaluate();

 private:
  struct Model;
  const std::unique_ptr<Model> model_;
};

}  // namespace selfcal
