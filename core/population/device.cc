#include "core/population/device.h"

#include <Eigen/Core>
#include <vector>

#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

// Directions that were held constant have the variance of the prior, 1 in its
// units, to rounding, or more where the covariance was widened.
constexpr double kHeldVariance = 1 - 1e-6;

}  // namespace

ThetaInformation DeviceInformation(const Rig& rig,
                                   const Calibration& theta,
                                   const Eigen::MatrixXd& covariance,
                                   const Calibration& reference) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd inverse_scale = PriorSigmas(rig)(free).cwiseInverse();
  const SymmetricEigen posterior(inverse_scale.asDiagonal() *
                                 covariance(free, free) *
                                 inverse_scale.asDiagonal());
  const Eigen::VectorXd information =
      (posterior.eigenvalues().array() < kHeldVariance)
          .select(posterior.eigenvalues().cwiseInverse(), 0.0);
  const Eigen::MatrixXd& U = posterior.eigenvectors();

  // The data has its minimum at theta: eta is zero there.
  SegmentInformation about_theta;
  about_theta.theta0 = theta;
  const auto all = TangentSize(theta);
  about_theta.Lambda.setZero(all, all);
  about_theta.eta.setZero(all);
  about_theta.Lambda(free, free) = inverse_scale.asDiagonal() * U *
                                   information.asDiagonal() * U.transpose() *
                                   inverse_scale.asDiagonal();
  return Transport(about_theta, reference);
}

}  // namespace selfcal
