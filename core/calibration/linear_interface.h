// The interface of a linear system: the dense information about the unknowns
// that chains keep, and its elimination down to theta.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <span>

#include "core/calibration/landmark_position.h"
#include "core/elimination/chain_elimination.h"

namespace selfcal {

class LinearInterface {
 public:
  // Begins with no information about `size` unknowns, and theta's `theta_size`.
  void Start(int size, int theta_size);
  // Adds a chain's information about theta and its kept unknowns, which are at
  // the indices `at` here, to the interface and to `theta`.
  void Add(const SharedInformation& of_chain,
           std::span<const int> at,
           SharedInformation* theta);
  // Adds the prior of a kept landmark, whose first unknown is at `at`.
  void AddLandmarkPrior(int at, const LandmarkPrior& prior);
  // Eliminates the interface from the information about theta. Returns by how
  // much the minimum decreases with theta held constant.
  double Eliminate(SharedInformation* theta);

  // The minimising step of the interface for a step of theta.
  Eigen::VectorXd Step(const Eigen::VectorXd& theta_step) const;
  // Covariance of (theta, interface), in this order, for a covariance of theta
  // (D x D).
  Eigen::MatrixXd Covariance(const Eigen::MatrixXd& theta_covariance) const;

 private:
  Eigen::MatrixXd information_, by_theta_;
  Eigen::VectorXd eta_;
  Eigen::LLT<Eigen::MatrixXd> root_;
};

}  // namespace selfcal
