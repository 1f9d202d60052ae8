// Refinement of one landmark with keyframes and calibration held. Pure, any
// thread.
#pragma once

#include <Eigen/Core>
#include <span>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// The landmark p_G [m] that lowers the Huber cost of its observations (indices
// into segment.observations), starting from start_G: at most two damped
// Gauss-Newton steps. Its distance is held weakly, to about half of itself, so
// that a point without parallax stays where it was. Never loses an observation
// that projected at the start; returns start_G where no step helps.
Eigen::Vector3d RefineLandmark(const Calibration& theta0,
                               double pixel_sigma_px,
                               const MotionSegment& segment,
                               std::span<const int> observations,
                               const Eigen::Vector3d& start_G);

}  // namespace selfcal
