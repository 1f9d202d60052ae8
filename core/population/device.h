// The contribution of one device to the statistics of its cohort, the devices
// of one model. Pure functions, callable from any thread.
#pragma once

#include <Eigen/Core>

#include "core/information/fusion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// The information of the data of a device about the offset of its theta from
// `reference`: Lambda (theta [-] reference) = eta. `covariance` (D x D, tangent
// at theta) is that of a calibration run, which estimates without a prior and
// leaves the variance of PriorSigmas(rig) to the directions that it holds
// constant: these have no information here, like the components that the rig
// holds fixed. `theta` and `reference` must have the shape of rig.factory.
ThetaInformation DeviceInformation(const Rig& rig,
                                   const Calibration& theta,
                                   const Eigen::MatrixXd& covariance,
                                   const Calibration& reference);

}  // namespace selfcal
