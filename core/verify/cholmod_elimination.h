// Gaussian elimination of a sparse least-squares problem down to its last
// columns, by the simplicial Cholesky factorisation of CHOLMOD.
//
// It calls only CHOLMOD's modules Core and Cholesky, which are
// LGPL-2.1-or-later (docs/licences.md).
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <optional>

namespace selfcal {

struct EliminatedColumns {
  // Minimised over all other columns, |J x + r|^2 is for the last columns y:
  // y^T Lambda y - 2 eta^T y + squares.
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;
  double squares = 0;
};

// Eliminates the columns of J in their order, except the last `kept`. Returns
// nullopt if J^T J is not positive definite to rounding, or memory runs out.
std::optional<EliminatedColumns> EliminateByCholmod(
    const Eigen::SparseMatrix<double, Eigen::RowMajor>& J,
    const Eigen::VectorXd& r,
    Eigen::Index kept);

}  // namespace selfcal
