// What a calibration from before a change of the device still says after it.
// Pure.
#pragma once

#include <Eigen/Core>

#include "core/calibration/theta_prior.h"
#include "core/model/rig.h"
#include "server/store/store.h"

namespace selfcal::server {

// The prior of the runs after it: what `before` (change.base_version) knows of
// the components that the change does not concern.
ThetaPrior KnownAfter(const Rig& rig,
                      const StoredChange& change,
                      const StoredCalibration& before);

// A covariance from before the change, with the rig's prior for the components
// that it concerns.
Eigen::MatrixXd CovarianceAfter(const Rig& rig,
                                const StoredChange& change,
                                const Eigen::MatrixXd& covariance);

}  // namespace selfcal::server
