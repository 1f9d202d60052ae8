// One segment as a ceres::Problem built from the Ceres factors: the same
// factors as SegmentLineariser's, evaluated by other code.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "core/information/inliers.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace ceres {
class Problem;
}  // namespace ceres

namespace selfcal {

// Includes the weak priors of weak_priors.h and the rig's prior of theta, both
// centred at the linearisation point; the gauge is held constant. The arguments
// must outlive it. Residual blocks are in this order: reprojections of the
// inliers (2 rows each), inertial links of each IMU in turn (15), priors. Theta
// varies in its free components, in units of the prior.
class SegmentProblem {
 public:
  SegmentProblem(const Rig& rig,
                 const Calibration& theta0,
                 const MotionSegment& segment,
                 const InlierSelection& selection,
                 int gauge_keyframe);
  ~SegmentProblem();

  ceres::Problem* problem();
  const double* theta() const;
  Eigen::Index theta_size() const { return theta_size_; }  // of its tangent
  // The variable parameter blocks: landmarks, keyframes in time, theta last
  // (unless the rig holds all of it fixed).
  std::vector<double*> BlocksInOrder();

 private:
  struct Model;
  const std::unique_ptr<Model> model_;
  const int gauge_keyframe_;
  Eigen::Index theta_size_ = 0;
};

}  // namespace selfcal
