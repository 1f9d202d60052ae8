// A chi-square test of two estimates of theta that should agree. Pure, any
// thread.
#pragma once

#include <Eigen/Core>

namespace selfcal {

struct AgreementTest {
  double statistic = 0;
  int degrees = 0;         // 0: not tested
  double probability = 1;  // of a statistic as large or larger by chance
};

// Tests what one says against what the rest say, both as information about the
// same offset, in units of the prior, with variances larger by `excess`. With
// one theta,
//   S = eta - Lambda (Lambda + Lambda_r)^-1 (eta + eta_r)
// is zero on average, with the covariance (Lambda^-1 + Lambda_r^-1)^-1. Only
// directions that both observe, better than the prior, are tested.
AgreementTest TestAgreement(const Eigen::MatrixXd& Lambda,
                            const Eigen::VectorXd& eta,
                            const Eigen::MatrixXd& rest_Lambda,
                            const Eigen::VectorXd& rest_eta,
                            double excess);

}  // namespace selfcal
