#include "core/change/sized_change.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace selfcal {

SizedChange ChangeOfSize(const Eigen::MatrixXd& L,
                         const Eigen::VectorXd& s,
                         double size) {
  Eigen::MatrixXd posterior = size * size * L;  // y / size has a unit prior
  posterior.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> llt(posterior);
  SizedChange change;
  change.mean = size * size * llt.solve(s);
  change.covariance =
      size * size * llt.solve(Eigen::MatrixXd::Identity(L.rows(), L.cols()));
  change.log_evidence =
      s.dot(change.mean) / 2 - llt.matrixLLT().diagonal().array().log().sum();
  return change;
}

}  // namespace selfcal
