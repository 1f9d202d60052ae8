// The unknowns of a chain: how many there are of each kind, and vectors of
// those of a keyframe.
#pragma once

#include <Eigen/Core>

#include "core/model/calibration.h"

namespace selfcal {

// Unknowns of a keyframe, as KeyframeState orders them (core/model/segment.h):
// rotation 3 [rad, right perturbation], position 3 [m, in G]; then velocity 3
// [m/s, in G], b_a 3 [m/s^2, in A], b_g 3 [rad/s, in I]; with a second IMU the
// same nine of that. The sizes of a chain are those of its ChainShape.
inline constexpr int kChainPoseSize = 6;
inline constexpr int kChainMotionSize = 9;
inline constexpr int kChainStateSize = kChainPoseSize + kChainMotionSize;
inline constexpr int kMaxChainMotionSize = 2 * kChainMotionSize;
inline constexpr int kMaxChainStateSize = kChainPoseSize + kMaxChainMotionSize;
// Limit of the number of link parameters: shared parameters on which links
// depend. They come first.
inline constexpr int kMaxChainLinkSize = kMaxLinkTangentSize;
// Limit of the number of further rows of a link (ChainTransition).
inline constexpr int kMaxChainLinkRows = kChainPoseSize;

using ChainStateVector =
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxChainStateSize, 1>;
using ChainStateMatrix = Eigen::Matrix<double,
                                       Eigen::Dynamic,
                                       Eigen::Dynamic,
                                       0,
                                       kMaxChainStateSize,
                                       kMaxChainStateSize>;

// White noise of a link: as many as unknowns of a state, then further rows.
inline constexpr int kMaxChainNoise = kMaxChainStateSize + kMaxChainLinkRows;
using ChainNoiseVector =
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxChainNoise, 1>;
using ChainNoiseMatrix = Eigen::Matrix<double,
                                       Eigen::Dynamic,
                                       Eigen::Dynamic,
                                       0,
                                       kMaxChainNoise,
                                       kMaxChainNoise>;

// The matrix B of landmark_rows.h.
using ChainPoseRotation = Eigen::Matrix<double, kChainPoseSize, 3>;

}  // namespace selfcal
