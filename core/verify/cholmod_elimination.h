// Gaussian elimination of a sparse least-squares problem down to its last
// columns, by the simplicial Cholesky factorisation of CHOLMOD.
//
// Only CHOLMOD's modules Core and Cholesky are called, which are
// LGPL-2.1-or-later (docs/licences.md).
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <optional>

namespace selfcal {

struct EliminatedColumns {
  // What |J x + r|^2 leaves for the last columns y, minimised over all others:
  // y^T Lambda y - 2 eta^T y + squares.
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;
  double squares = 0;
};

// Eliminates the columns of J in their order, but for the last `kept`. Nothing
// where J^T J is not positive definite to rounding, or memory runs out.
std::optional<EliminatedColumns> EliminateByCholmod(
    const Eigen::SparseMatrix<double, Eigen::RowMajor>& J,
    const Eigen::VectorXd& r,
    Eigen::Index kept);

}  // namespace selfcal
