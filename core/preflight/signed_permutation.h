// The 48 signed permutations of a sensor's axes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

namespace selfcal {

// Signed permutation matrices; the identity is the first, and those with fewer
// changed axes come first.
const std::array<Eigen::Matrix3d, 48>& SignedPermutations();

// "(y, -x, z)": the received axes in terms of x, y, z, in order and with signs.
std::string AxesText(const Eigen::Matrix3d& true_from_fed);

}  // namespace selfcal
