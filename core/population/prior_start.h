// The start of a run of a rig whose prior has a mean of its own
// (Rig::prior_mean). Pure.
#pragma once

#include <Eigen/Core>

#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// A run leaves the directions that its data does not determine where it starts.
// Those of an earlier run, whose result theta with its covariance (D x D,
// tangent at theta) is, may therefore have values from before the rig had this
// mean. The result here has those of PriorMean(rig) there, and those of theta
// in directions that its data determines: it maximises the posterior of the
// information of that data (DeviceInformation) and the prior of the rig.
// `theta` must have the shape of rig.factory.
Calibration StartFromPrior(const Rig& rig,
                           const Calibration& theta,
                           const Eigen::MatrixXd& covariance);

}  // namespace selfcal
