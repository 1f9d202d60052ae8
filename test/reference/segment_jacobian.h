// The whitened Jacobian of one segment as the paper writes it: all factors,
// all unknowns, theta last. An assembly of its own, for tests and benchmarks to
// compare the structured elimination with.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "core/information/inliers.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Minimised is |r + J d|^2. Columns: landmarks (3 each, those with inliers),
// keyframes in time order (15 each; that with the gauge 11), theta in units of
// theta_scale, without components of scale 0.
struct SegmentJacobian {
  Eigen::SparseMatrix<double> J;
  Eigen::VectorXd r;
  int theta_size = 0;
};

SegmentJacobian BuildSegmentJacobian(const Rig& rig,
                                     const Calibration& theta0,
                                     const MotionSegment& segment,
                                     const InlierSelection& selection,
                                     const Eigen::VectorXd& theta_scale,
                                     int gauge_keyframe);

}  // namespace selfcal
