// What a calibration run estimates, for linear data.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/information/fusion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {

struct RunEstimate {
  Calibration theta;
  Eigen::MatrixXd covariance;  // D x D, tangent at theta
};

// Without a prior, along the directions about which the data has more
// information than the prior. The others remain at the factory's value, with
// the prior's variance.
inline RunEstimate EstimateAsARun(const Rig& rig,
                                  const SegmentInformation& data) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  const Eigen::VectorXd scale = sigmas(free);
  const SymmetricEigen eigen(scale.asDiagonal() * data.Lambda(free, free) *
                             scale.asDiagonal());
  const Eigen::MatrixXd& U = eigen.eigenvectors();
  const Eigen::ArrayXd information = eigen.eigenvalues();
  const Eigen::ArrayXd known = (information > 1).cast<double>();
  const Eigen::ArrayXd variance =
      (information > 1).select(information.inverse(), 1.0);
  const Eigen::VectorXd about_factory =
      data.eta + data.Lambda * BoxMinus(data.theta0, rig.factory);
  Eigen::VectorXd offset = Eigen::VectorXd::Zero(sigmas.size());
  offset(free) = scale.asDiagonal() * U *
                 (known * variance).matrix().asDiagonal() * U.transpose() *
                 scale.cwiseProduct(about_factory(free));
  RunEstimate estimate{BoxPlus(rig.factory, offset),
                       Eigen::MatrixXd::Zero(sigmas.size(), sigmas.size())};
  estimate.covariance(free, free) = scale.asDiagonal() * U *
                                    variance.matrix().asDiagonal() *
                                    U.transpose() * scale.asDiagonal();
  return estimate;
}

}  // namespace selfcal
