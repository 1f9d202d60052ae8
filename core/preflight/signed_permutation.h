// The 48 ways in which a sensor's axes can be swapped and flipped.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

namespace selfcal {

// Signed permutation matrices; the identity is the first, and those that change
// fewer axes come before those that change more.
const std::array<Eigen::Matrix3d, 48>& SignedPermutations();

// "(y, -x, z)": in this order and with these signs the fed axes are x, y, z.
std::string AxesText(const Eigen::Matrix3d& true_from_fed);

}  // namespace selfcal
