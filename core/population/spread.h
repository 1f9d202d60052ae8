// Internal to core/population: how devices of a cohort differ, with the share
// of the correlations that is kept fixed. All values are in units of `scale` of
// the cohort (estimate.h).
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "core/information/fusion.h"

namespace selfcal {

struct Spread {
  Eigen::VectorXd mu;
  Eigen::MatrixXd mu_covariance;
  Eigen::MatrixXd S;  // of devices about mu; positive definite
  // How many devices' worth of differences are known, for each component.
  Eigen::VectorXd degrees;
};

// Nothing known: mu is 0 within the scale, as is each device.
Spread InitialSpread(Eigen::Index size);

// The spread by medians, one component at a time, so that broken devices do not
// hide themselves. A component that fewer than kLeastCohort devices determine
// stays as in InitialSpread.
Spread RobustSpread(std::span<const ThetaInformation> devices,
                    Eigen::Index size);

// Restricted maximum likelihood by expectation-maximisation. Devices need not
// observe all directions. `correlation` in [0, 1) is the share of the
// correlations of S that is kept. A gamma(2) prior on the standard deviations
// keeps them from zero (Chung et al., Psychometrika 2013). Ends early once
// `cancelled`, if there is one, returns true.
Spread FitSpread(std::span<const ThetaInformation> devices,
                 Eigen::Index size,
                 double correlation,
                 const std::function<bool()>& cancelled = {});

// Log-likelihood of the data of a device, up to what depends on the data alone.
double LogLikelihood(const ThetaInformation& device, const Spread& spread);

}  // namespace selfcal
