#include "core/calibration/agreement.h"

#include <Eigen/Cholesky>

#include "core/change/chi_square.h"
#include "core/change/consistency.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {

AgreementTest TestAgreement(const Eigen::MatrixXd& Lambda,
                            const Eigen::VectorXd& eta,
                            const Eigen::MatrixXd& rest_Lambda,
                            const Eigen::VectorXd& rest_eta,
                            double excess) {
  AgreementTest test;
  if (Lambda.size() == 0) return test;
  Eigen::MatrixXd all = Lambda + rest_Lambda;
  all.diagonal().array() += 1e-9 * all.trace();
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(all);
  const Eigen::VectorXd score = eta - Lambda * ldlt.solve(eta + rest_eta);
  const Eigen::MatrixXd covariance = Lambda - Lambda * ldlt.solve(Lambda);
  const SymmetricEigen eigen((covariance + covariance.transpose()) / 2);
  const Eigen::VectorXd along = eigen.eigenvectors().transpose() * score;
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    // Both sides have more information than the prior.
    if (!(eigen.eigenvalues()(i) > kObserved)) continue;
    ++test.degrees;
    test.statistic += along(i) * along(i) / eigen.eigenvalues()(i);
  }
  test.statistic /= excess;
  if (test.degrees > 0) {
    test.probability = ChiSquareTail(test.statistic, test.degrees);
  }
  return test;
}

}  // namespace selfcal
