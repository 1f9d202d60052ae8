// Interfaces of the linear system of a calibration: the whitening of its
// inertial factors as input, and as output its information in terms of the
// offset that the solver moves. Pure.
#pragma once

#include <vector>

#include "core/calibration/chain_thetas.h"
#include "core/calibration/problem.h"
#include "core/elimination/chain_elimination.h"
#include "core/factor/inertial.h"
#include "core/factor/inertial_batch.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// Square root information of every inertial link, in their order, at the given
// estimate. It is constant within one round while the estimate moves.
std::vector<InertialMatrix> WhitenInertialLinks(
    const Rig& rig,
    const ChainThetas& thetas,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes);

// U with U^-1 = W, a square root information of a link.
InertialNoiseRoot NoiseRootOf(const InertialMatrix& W);

// The same information about the offset d from a reference (theta = reference
// [+] d), in which the solver works.
SharedInformation ByOffset(const SharedInformation& at_theta,
                           const Eigen::MatrixXd& theta_by_offset);

}  // namespace selfcal
