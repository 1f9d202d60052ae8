// The eigendecomposition of dense symmetric matrices. Only their lower triangle
// is read. Eigen's solver takes seconds to compile in each source that uses it;
// here it is compiled once.
#pragma once

#include <Eigen/Core>

namespace selfcal {

class SymmetricEigen {
 public:
  explicit SymmetricEigen(const Eigen::MatrixXd& matrix);

  // Ascending.
  const Eigen::VectorXd& eigenvalues() const { return values_; }
  // Orthonormal, a column for each eigenvalue.
  const Eigen::MatrixXd& eigenvectors() const { return vectors_; }

 private:
  Eigen::VectorXd values_;
  Eigen::MatrixXd vectors_;
};

// Ascending.
Eigen::VectorXd SymmetricEigenvalues(const Eigen::MatrixXd& matrix);

}  // namespace selfcal
