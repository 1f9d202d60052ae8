// A whole calibration problem at one estimate: all factors linearised and
// whitened, to be eliminated down to theta. Pure.
#pragma once

#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/calibration/screening.h"
#include "core/calibration/sparse_elimination.h"
#include "core/elimination/chain_elimination.h"
#include "core/factor/inertial.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// Square root information of every inertial link, in their order, at the given
// estimate. It stays fixed while the estimate moves, within one round.
std::vector<InertialMatrix> WhitenInertialLinks(
    const Rig& rig,
    const ImuCalibration& imu,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes);

// Adds all factors, linearised and whitened at the estimate, and the gauge to a
// system whose shared parameters are the tangent at theta, prior on theta not
// included. With a loss, residuals are weighted as in iteratively reweighted
// least squares: for the Huber loss on normal residuals, the inverse of Lambda
// is then the covariance of the estimate to 1 %. Without (null), all count
// fully. The weak priors of the score keep states proper that nothing
// determines; centred at the estimate, they move nothing. Landmarks come in
// their order, by (alpha, beta, rho); those that do not have two observations
// left to stand on are left out. Returns the indices of the others.
std::vector<int> LineariseProblem(
    const Rig& rig,
    const Calibration& theta,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes,
    const std::vector<ScreenedLandmark>& landmarks,
    const std::vector<InertialMatrix>& whitening,
    const RobustLoss* loss,
    SparseElimination* system);

// The same information by the offset d from a reference (theta = reference [+]
// d), in which the solver works.
SharedInformation ByOffset(const SharedInformation& at_theta,
                           const Eigen::MatrixXd& theta_by_offset);

// The derivative of (reference [+] d) [-] theta by d, at theta = reference [+]
// d: the identity but for the right Jacobians of rotations.
Eigen::MatrixXd ThetaByOffset(const Calibration& reference,
                              const Eigen::VectorXd& d);

}  // namespace selfcal
