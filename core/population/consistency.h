// Is a device like its cohort, and like what its rig states? Pure functions,
// callable from any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/information/fusion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/population/estimate.h"

namespace selfcal {

struct CohortComponent {
  int component = 0;
  double difference = 0;   // of the device from the mean, where observed
  double sigma = 0;        // that is expected of it
  double probability = 1;  // two-sided, of a device of the cohort
};

struct CohortConsistency {
  // Chance that the estimate of a device of the cohort, with what its data
  // knows and the cohort as its prior, is farther from the mean, or that it has
  // a component that is less likely than the least likely one: the smaller one,
  // for two tests. The distance counts each direction by the share of it that
  // the data knows, so that many that are known a little count together.
  double probability = 1;
  // Components that the device knows at least as well as its cohort does, the
  // least likely first.
  std::vector<CohortComponent> components;
};

// `device` must not be among cohort.devices.
CohortConsistency CompareWithCohort(const Cohort& cohort,
                                    const ThetaInformation& device);

struct PriorAgreement {
  double statistic = 0;  // chi-square over the directions that are observed
  int degrees = 0;
  double probability = 1;  // of a larger statistic, if the prior holds
  // Errors that the data shows of the prior, over those that it states; 1 if
  // they are smaller.
  double prior_error_ratio = 1;
  // Root mean square error of the estimate, over the stated one, if the prior
  // is as wrong in the directions that the data does not show. 1 if it does not
  // matter: the data determines everything, or agrees with the prior.
  double error_ratio = 1;
};

// Compares the data of a device with the prior of its rig, PriorSigmas(rig)
// about PriorMean(rig). `theta` with `covariance` (D x D, tangent at theta) is
// that of a calibration run (DeviceInformation).
PriorAgreement CompareWithPrior(const Rig& rig,
                                const Calibration& theta,
                                const Eigen::MatrixXd& covariance);

}  // namespace selfcal
