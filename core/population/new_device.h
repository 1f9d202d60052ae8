// The rig of a new device of a cohort. Pure.
#pragma once

#include "core/model/rig.h"
#include "core/population/estimate.h"

namespace selfcal {

// `rig`, whose cameras are those of cohort.reference, with the mean of the
// cohort as its factory calibration, and as its prior_sigmas the standard
// deviations of a device about that mean, as far as both are known. Tolerances
// have no correlations: those of the cohort are left out.
Rig DescribeNewDevice(Rig rig, const Cohort& cohort);

}  // namespace selfcal
