// A chi-square test of two estimates of theta that should agree. Pure, callable
// from any thread.
#pragma once

#include <Eigen/Core>

namespace selfcal {

struct AgreementTest {
  double statistic = 0;
  int degrees = 0;         // 0: not tested
  double probability = 1;  // of a statistic at least as large by chance
};

// Tests one estimate against the rest, both as information about the same
// offset, in units of the prior, with variances scaled by `excess`. For the
// same theta,
//   S = eta - Lambda (Lambda + Lambda_r)^-1 (eta + eta_r)
// has zero mean and the covariance (Lambda^-1 + Lambda_r^-1)^-1. Only
// directions that both observe better than the prior are tested.
AgreementTest TestAgreement(const Eigen::MatrixXd& Lambda,
                            const Eigen::VectorXd& eta,
                            const Eigen::MatrixXd& rest_Lambda,
                            const Eigen::VectorXd& rest_eta,
                            double excess);

}  // namespace selfcal
