// A hypothesis: a change of known size, normal with so many prior sigmas in
// each of its directions, given what segments show of it.
//
// Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <array>

namespace selfcal {

// Sizes of an uncertain change, in prior sigmas, each as likely as another: its
// order of magnitude is not known.
inline constexpr std::array<double, 5> kChangeSizes = {0.01, 0.03, 0.1, 0.3, 1};

struct SizedChange {
  // ln of how much more probable the data is than without any change.
  double log_evidence = 0;
  // The posterior of y, given that it changed.
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

// The change is y ~ N(0, size^2 I); L and s are the information about it:
// s ~ N(L y, L).
SizedChange ChangeOfSize(const Eigen::MatrixXd& L,
                         const Eigen::VectorXd& s,
                         double size);

}  // namespace selfcal
