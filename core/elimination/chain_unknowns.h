// The unknowns of a chain: how many there are of each kind, and vectors of
// those of a keyframe.
#pragma once

#include <Eigen/Core>

#include "core/model/calibration.h"

namespace selfcal {

// Unknowns of a keyframe, as KeyframeState orders them (core/model/segment.h):
// rotation 3 [rad, right perturbation], position 3 [m, in G]; then velocity 3
// [m/s, in G], b_a 3 [m/s^2, in A], b_g 3 [rad/s, in I].
inline constexpr int kChainPoseSize = 6;
inline constexpr int kChainMotionSize = 9;
inline constexpr int kChainStateSize = kChainPoseSize + kChainMotionSize;
// Limit of the number of link parameters: shared parameters on which links
// depend. They come first.
inline constexpr int kMaxChainLinkSize = kMaxImuTangentSize;

using ChainStateVector = Eigen::Matrix<double, kChainStateSize, 1>;
using ChainStateMatrix =
    Eigen::Matrix<double, kChainStateSize, kChainStateSize>;

// The matrix B of landmark_rows.h.
using ChainPoseRotation = Eigen::Matrix<double, kChainPoseSize, 3>;

}  // namespace selfcal
