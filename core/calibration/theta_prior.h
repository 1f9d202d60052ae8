// What is known about theta before any segment is looked at. Pure.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// Normal about `centre`; of a direction without information nothing is known.
struct ThetaPrior {
  Calibration centre;
  Eigen::MatrixXd information;  // D x D, tangent at centre, semidefinite
};

// PriorSigmas(rig) about the factory's calibration.
ThetaPrior FactoryPrior(const Rig& rig);

// What a calibration with its covariance (D x D) says about some components
// alone, all others marginalised: of these nothing remains known. Components
// that the rig holds fixed are left out.
ThetaPrior MarginalPrior(const Rig& rig,
                         const Calibration& theta,
                         const Eigen::MatrixXd& covariance,
                         const std::vector<int>& components);

}  // namespace selfcal
