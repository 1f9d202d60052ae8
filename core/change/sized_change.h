// A hypothesis: a change of known size, normal with this many prior sigmas in
// each of its directions, given the information of segments about it.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <array>

namespace selfcal {

// Equally likely sizes of an uncertain change, in prior sigmas: its order of
// magnitude is unknown.
inline constexpr std::array<double, 5> kChangeSizes = {0.01, 0.03, 0.1, 0.3, 1};

struct SizedChange {
  // ln of the likelihood ratio relative to no change.
  double log_evidence = 0;
  // Posterior of y, given that there was a change.
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

// The change is y ~ N(0, size^2 I); L and s are the information about it:
// s ~ N(L y, L).
SizedChange ChangeOfSize(const Eigen::MatrixXd& L,
                         const Eigen::VectorXd& s,
                         double size);

}  // namespace selfcal
