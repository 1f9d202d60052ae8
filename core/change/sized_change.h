// A change of which the size is known, as a hypothesis: normal, of so many
// prior sigmas in each of its directions, given what segments show of it.
//
// Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <array>

namespace selfcal {

// Sizes of a change that is not sure, in prior sigmas, each as likely as
// another: how large it is is not known, by orders of magnitude.
inline constexpr std::array<double, 5> kChangeSizes = {0.01, 0.03, 0.1, 0.3, 1};

struct SizedChange {
  // ln of how much more probable the data is than without any change.
  double log_evidence = 0;
  // Of y, given that it changed.
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

// Of a change y ~ N(0, size^2 I) of which L and s are the information: s ~
// N(L y, L).
SizedChange ChangeOfSize(const Eigen::MatrixXd& L,
                         const Eigen::VectorXd& s,
                         double size);

}  // namespace selfcal
