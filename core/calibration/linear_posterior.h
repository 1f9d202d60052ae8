// What the solution of a linear system says about its own factors.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/factor/inertial.h"

namespace selfcal {

// Posterior of a linear system by kind of factor: squares of whitened residuals
// at the minimum, and how much of each the unknowns absorb, which is the trace
// of its hat matrix.
struct LinearPosterior {
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  // Whitened residual of each inertial link, and its covariance.
  std::vector<InertialResidual> inertial;
  std::vector<InertialMatrix> inertial_covariance;
  // Sums over bias links, by component. The redundancy is the number of links
  // minus the absorbed part.
  Vector6 walk_squares, walk_redundancy;
  int walk_rows = 0;  // each walk has two, due to the unknown in its middle
  double prior_squares = 0, prior_absorbed = 0;  // weak priors and gauge
  // Reprojections, and the weak prior of each landmark.
  double pixel_squares = 0;
  // Observations have the weight w from screening, not that of the loss: sum w,
  // and sum w^2 / sum w, the weight of the absorbed part; the latter also for
  // each landmark, summed.
  double weighted_observations = 0;
  double weight_of_absorbed = 0, landmark_weights = 0;
  int observations = 0;
  int landmarks = 0;
  int unknowns = 0;  // all except theta
};

}  // namespace selfcal
