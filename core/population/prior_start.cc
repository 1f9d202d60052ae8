#include "core/population/prior_start.h"

#include <span>

#include "core/information/fusion.h"
#include "core/population/device.h"

namespace selfcal {

Calibration StartFromPrior(const Rig& rig,
                           const Calibration& theta,
                           const Eigen::MatrixXd& covariance) {
  const ThetaInformation data =
      DeviceInformation(rig, theta, covariance, theta);
  SegmentInformation about_theta;
  about_theta.theta0 = theta;
  about_theta.Lambda = data.Lambda;
  about_theta.eta = data.eta;
  return Fuse(rig, std::span(&about_theta, 1)).theta;
}

}  // namespace selfcal
