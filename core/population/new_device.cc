#include "core/population/new_device.h"

#include <cmath>

#include "core/model/calibration.h"

namespace selfcal {

Rig DescribeNewDevice(Rig rig, const Cohort& cohort) {
  const DevicePrediction device = PredictDevice(cohort);
  rig.factory = BoxPlus(cohort.reference, device.mean);
  rig.prior_mean.reset();
  rig.prior_sigmas.clear();
  Eigen::Index k = 0;
  for (const TangentComponent& component : TangentComponents(rig.factory)) {
    const double variance = device.covariance(k, k);
    ++k;
    if (variance > 0) {
      rig.prior_sigmas.push_back({component.name, std::sqrt(variance)});
    }
  }
  return rig;
}

}  // namespace selfcal
