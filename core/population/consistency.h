// Is a device like its cohort? Pure functions, callable from any thread.
#pragma once

#include <vector>

#include "core/information/fusion.h"
#include "core/population/estimate.h"

namespace selfcal {

struct CohortComponent {
  int component = 0;
  double difference = 0;   // of the device from the mean, where observed
  double sigma = 0;        // that is expected of it
  double probability = 1;  // two-sided, of a device of the cohort
};

struct CohortConsistency {
  double statistic = 0;  // chi-square over the directions that are observed
  int degrees = 0;
  // Chance that a device of the cohort has a larger statistic, or a component
  // that is less likely than the least likely one: the smaller one, for two
  // tests.
  double probability = 1;
  // Components that the device knows at least as well as its cohort does, the
  // least likely first.
  std::vector<CohortComponent> components;
};

// `device` must not be among cohort.devices.
CohortConsistency CompareWithCohort(const Cohort& cohort,
                                    const ThetaInformation& device);

}  // namespace selfcal
