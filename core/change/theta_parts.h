// Parts of theta that change together: a knock rotates a camera, a warm lens
// has another focal length. A test of few parameters detects a smaller change
// than one of all of theta.
//
// Pure, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

struct ThetaPart {
  // "all", the name of a group, or that of the components without their axis:
  // "cam0.q_CI", "imu.gyro.scale"; "cam0.zoom" is a common relative change of
  // both focal lengths.
  std::string name;
  // Free components by k, in units of the prior's sigmas: orthonormal columns.
  Eigen::MatrixXd basis;
  // Indices of its free components, ascending.
  std::vector<int> at;
  // Its share of the level of tests and of the prior of a change; those of all
  // ThetaParts sum to 1.
  double share = 0;
};

// The groups of the rig, in their order.
std::vector<ThetaPart> GroupParts(const Rig& rig);

// All of theta first, then the groups of the rig in their order, then their
// parts. Of parts with the same components, only the first. Half of all shares
// is for the most frequent isolated changes: the attitude of a camera, which a
// knock rotates, and its zoom, which grows with temperature.
std::vector<ThetaPart> ThetaParts(const Rig& rig);

}  // namespace selfcal
