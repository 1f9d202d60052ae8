// Which tracks of a problem will show how far away their landmark is, before
// anything is triangulated: by where the SLAM system saw it from.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/calibration/problem.h"
#include "core/model/rig.h"

namespace selfcal {

// Of each track: whether it has the observations, and its landmark the
// parallax, without which screening drops it (screening.h). `landmarks_G` are
// the places of the landmarks in the SLAM system's map, one of each track; the
// scene by whose median inverse depth they are judged is that of these tracks.
std::vector<bool> TracksWithDepth(const Rig& rig,
                                  std::span<const KeyframeState> keyframes,
                                  std::span<const Track> tracks,
                                  std::span<const Eigen::Vector3d> landmarks_G);

}  // namespace selfcal
