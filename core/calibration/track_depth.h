// Predicts which tracks of a problem will determine the depth of their
// landmark, before triangulation: from the positions from which the SLAM system
// observed it.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/calibration/problem.h"
#include "core/model/rig.h"

namespace selfcal {

// Returns for each track whether it has the observations, and its landmark the
// parallax, without which screening drops it (screening.h). `landmarks_G` are
// the positions of the landmarks in the SLAM system's map, one for each track;
// the median inverse depth of the scene is that of these tracks.
std::vector<bool> TracksWithDepth(const Rig& rig,
                                  std::span<const KeyframeState> keyframes,
                                  std::span<const Track> tracks,
                                  std::span<const Eigen::Vector3d> landmarks_G);

}  // namespace selfcal
