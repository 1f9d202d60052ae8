#include "core/calibration/linear_interface.h"

namespace selfcal {

void LinearInterface::Start(int size, int theta_size) {
  information_.setZero(size, size);
  by_theta_.setZero(size, theta_size);
  eta_.setZero(size);
}

void LinearInterface::Add(const SharedInformation& of_chain,
                          std::span<const int> at,
                          SharedInformation* theta) {
  const Eigen::Index D = theta->eta.size();
  const Eigen::MatrixXd& Lambda = of_chain.Lambda;
  theta->Lambda += Lambda.topLeftCorner(D, D);
  theta->eta += of_chain.eta.head(D);
  for (std::size_t j = 0; j < at.size(); ++j) {
    const Eigen::Index column = D + static_cast<Eigen::Index>(j);
    for (std::size_t i = 0; i < at.size(); ++i) {
      information_(at[i], at[j]) +=
          Lambda(D + static_cast<Eigen::Index>(i), column);
    }
    by_theta_.row(at[j]) += Lambda.col(column).head(D).transpose();
    eta_(at[j]) += of_chain.eta(column);
  }
}

void LinearInterface::AddLandmarkPrior(int at, const LandmarkPrior& prior) {
  information_.block<3, 3>(at, at) += prior.H;
  eta_.segment<3>(at) -= prior.g;
}

double LinearInterface::Eliminate(SharedInformation* theta) {
  if (eta_.size() == 0) return 0;
  root_.compute(information_);
  // The information about the depth of a landmark near infinity may be lost to
  // rounding: it gets the least amount that is distinguishable from none.
  for (double add = 1e-14; root_.info() != Eigen::Success && add < 1;
       add *= 10) {
    information_.diagonal() *= 1 + add;
    root_.compute(information_);
  }
  const Eigen::MatrixXd by_theta = root_.solve(by_theta_);
  const Eigen::VectorXd at_rest = root_.solve(eta_);
  theta->Lambda -= by_theta_.transpose() * by_theta;
  theta->Lambda = (0.5 * (theta->Lambda + theta->Lambda.transpose())).eval();
  theta->eta -= by_theta_.transpose() * at_rest;
  return eta_.dot(at_rest);
}

Eigen::VectorXd LinearInterface::Step(const Eigen::VectorXd& theta_step) const {
  if (eta_.size() == 0) return Eigen::VectorXd(0);
  return root_.solve(eta_ - by_theta_ * theta_step);
}

Eigen::MatrixXd LinearInterface::Covariance(
    const Eigen::MatrixXd& theta_covariance) const {
  const Eigen::Index size = eta_.size();
  if (size == 0) return theta_covariance;
  const Eigen::Index D = theta_covariance.rows();
  Eigen::MatrixXd covariance(D + size, D + size);
  const Eigen::MatrixXd by_theta = root_.solve(by_theta_);
  const Eigen::MatrixXd with_theta = -by_theta * theta_covariance;
  covariance << theta_covariance, with_theta.transpose(), with_theta,
      root_.solve(Eigen::MatrixXd::Identity(size, size)) -
          with_theta * by_theta.transpose();
  return covariance;
}

}  // namespace selfcal
