// Parts of theta that a device changes by: a knock turns a camera, a warm lens
// has another focal length. A test of few parameters finds a smaller change
// than one of all of theta.
//
// Pure, any thread.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

struct ParameterBlock {
  // "all", the name of a group, or that of the components without their axis:
  // "cam0.q_CI", "imu.gyro.scale"; "cam0.zoom" is both focal lengths by the
  // same share.
  std::string name;
  // Free components by k, in units of the prior's sigmas: orthonormal.
  Eigen::MatrixXd basis;
  // Free components of it, ascending.
  std::vector<int> at;
  // Its part of the level of tests and of the prior of a change; those of all
  // ParameterBlocks sum to 1.
  double share = 0;
};

// The groups of the rig, in their order.
std::vector<ParameterBlock> GroupBlocks(const Rig& rig);

// All of theta first, then the groups of the rig in their order, then the
// parts of these. Of blocks with the same components, the first. Half of all
// shares is for what changes most often by itself: the attitude of a camera,
// which a knock turns, and its zoom, which grows with warmth.
std::vector<ParameterBlock> ParameterBlocks(const Rig& rig);

}  // namespace selfcal
