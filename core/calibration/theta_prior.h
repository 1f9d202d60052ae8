// Prior on theta, before any segment is used. Pure.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// Normal distribution about `centre`; a direction without information is
// unconstrained.
struct ThetaPrior {
  Calibration centre;
  Eigen::MatrixXd information;  // D x D, tangent at centre, semidefinite
};

// The prior of a rig: PriorSigmas(rig) about PriorMean(rig).
ThetaPrior FactoryPrior(const Rig& rig);

// Prior from a calibration with its covariance (D x D) for some components,
// with all others marginalised; these are then unconstrained. Components that
// the rig holds fixed are excluded.
ThetaPrior MarginalPrior(const Rig& rig,
                         const Calibration& theta,
                         const Eigen::MatrixXd& covariance,
                         const std::vector<int>& components);

}  // namespace selfcal
