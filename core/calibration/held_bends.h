// The effect of directions that are held constant on the estimated ones beyond
// the first order.
//
// A direction is held although the data observe it if the problem is not linear
// within its sigma (linear_range.h): as for a unified camera, whose xi, focal
// lengths and distortion describe nearly the same lens along a curve. An error
// h along the direction moves the minimum of the others by L h + q h^2. L is in
// their covariance (CovarianceWithHeld); if the others are determined far
// better than this one, q h^2 exceeds their sigmas all the same.
//
// Pure, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>

#include "core/calibration/working_point.h"

namespace selfcal {

// One column for each direction that the estimate holds although the data say
// at least as much about it as the prior, D x k, in units of the tangent: the
// root mean square of q h^2, given what the data and the prior say about h. q
// is the mean of the minima with the direction held at one sigma of h to either
// side, less the present one, over the variance of h. At most one sigma of the
// prior long. Directions for which these minima are not reached have no column.
Eigen::MatrixXd BendsOfHeld(const WorkingPoint& point);

}  // namespace selfcal
