// Information about theta_s, the calibration at the temperature of a segment,
// in terms of theta and its slopes (core/model/temperature.h). Pure.
#pragma once

#include <Eigen/Core>

#include "core/elimination/chain_elimination.h"

namespace selfcal {

// `derivative` (D0 x D) is that of theta_s by theta, and the information is
// about (theta_s, others), in this order. The result is about (theta, others).
SharedInformation ByTheta(const Eigen::MatrixXd& derivative,
                          const SharedInformation& given);

}  // namespace selfcal
