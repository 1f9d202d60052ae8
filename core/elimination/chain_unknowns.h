// The unknowns of a chain: how many there are of each kind, and vectors of
// those of a keyframe.
#pragma once

#include <Eigen/Core>

#include "core/model/calibration.h"

namespace selfcal {

// Unknowns of a keyframe: pose 6, then velocity and biases 9.
inline constexpr int kChainPoseSize = 6;
inline constexpr int kChainMotionSize = 9;
inline constexpr int kChainStateSize = kChainPoseSize + kChainMotionSize;
// Shared parameters on which links depend; they come first.
inline constexpr int kChainLinkShared = kImuTangentSize;

using ChainStateVector = Eigen::Matrix<double, kChainStateSize, 1>;
using ChainStateMatrix =
    Eigen::Matrix<double, kChainStateSize, kChainStateSize>;

// The matrix B of landmark_rows.h.
using ChainPoseRotation = Eigen::Matrix<double, kChainPoseSize, 3>;

}  // namespace selfcal
