#include "core/model/symmetric_eigen.h"

#include <Eigen/Eigenvalues>

namespace selfcal {

SymmetricEigen::SymmetricEigen(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  values_ = solver.eigenvalues();
  vectors_ = solver.eigenvectors();
}

Eigen::VectorXd SymmetricEigenvalues(const Eigen::MatrixXd& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix,
                                                        Eigen::EigenvaluesOnly)
      .eigenvalues();
}

}  // namespace selfcal
