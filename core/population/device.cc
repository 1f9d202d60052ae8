#include "core/population/device.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <vector>

#include "core/model/symmetric_eigen.h"

namespace selfcal {

ThetaInformation DeviceInformation(const Rig& rig,
                                   const Calibration& theta,
                                   const Eigen::MatrixXd& covariance,
                                   const Calibration& reference) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd scale = PriorSigmas(rig)(free);
  const auto size = static_cast<Eigen::Index>(free.size());
  const auto identity = Eigen::MatrixXd::Identity(size, size);

  // In units of the prior's sigmas, about theta.
  const Eigen::VectorXd inverse_scale = scale.cwiseInverse();
  const Eigen::MatrixXd posterior = inverse_scale.asDiagonal() *
                                    covariance(free, free) *
                                    inverse_scale.asDiagonal();
  const Eigen::MatrixXd prior_by_offset =
      ThetaByOffset(rig.factory, BoxMinus(theta, rig.factory));
  const Eigen::MatrixXd offset_by_theta =
      inverse_scale.asDiagonal() *
      prior_by_offset(free, free).inverse().eval() * scale.asDiagonal();
  const Eigen::MatrixXd prior = offset_by_theta.transpose() * offset_by_theta;
  const Eigen::MatrixXd data = posterior.llt().solve(identity) - prior;

  // A covariance that was widened has less information than the prior in
  // directions without data: nothing is known of these.
  const SymmetricEigen eigen(0.5 * (data + data.transpose()));
  const Eigen::VectorXd known =
      (eigen.eigenvalues().array() > 0).cast<double>();
  const Eigen::MatrixXd& U = eigen.eigenvectors();
  const Eigen::MatrixXd Lambda =
      U * eigen.eigenvalues().cwiseMax(0).asDiagonal() * U.transpose();
  // Data and prior balance at the maximum of the posterior.
  const Eigen::VectorXd from_factory =
      inverse_scale.cwiseProduct(BoxMinus(theta, rig.factory)(free));
  const Eigen::VectorXd eta = U * known.asDiagonal() * U.transpose() *
                              offset_by_theta.transpose() * from_factory;

  SegmentInformation about_theta;
  about_theta.theta0 = theta;
  const auto all = TangentSize(theta);
  about_theta.Lambda.setZero(all, all);
  about_theta.eta.setZero(all);
  about_theta.Lambda(free, free) =
      inverse_scale.asDiagonal() * Lambda * inverse_scale.asDiagonal();
  about_theta.eta(free) = inverse_scale.cwiseProduct(eta);
  return Transport(about_theta, reference);
}

}  // namespace selfcal
