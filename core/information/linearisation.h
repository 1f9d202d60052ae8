// The whitened, linearised factors of a segment, handed to the elimination in
// the order it needs (section IV-A, steps 1 and 2). Pure, any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/elimination/chain_elimination.h"
#include "core/information/inliers.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct LinearisedSegment {
  SharedInformation theta;  // in units of theta_scale
  // Root mean square of the whitened inertial residuals, by kind (rotation,
  // velocity, position, b_a, b_g).
  std::vector<double> inertial_rms;
};

// Linearises the inliers, all inertial factors and the weak priors of
// weak_priors.h at the segment's states, the selection's landmarks and theta0,
// and eliminates everything but theta. theta_scale is the unit of each tangent
// component; 0 leaves a component out. The keyframe gauge_keyframe is held in
// position and in rotation about gravity.
LinearisedSegment EliminateSegment(const Rig& rig,
                                   const Calibration& theta0,
                                   const MotionSegment& segment,
                                   const InlierSelection& selection,
                                   const Eigen::VectorXd& theta_scale,
                                   int gauge_keyframe);

}  // namespace selfcal
