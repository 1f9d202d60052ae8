// Positions of tracks that the SLAM system has not triangulated.
//
// Pure, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/calibration/problem.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal::client {

// Returns the position of each track in G [m], with keyframes and theta held
// constant, and exposures at the timestamps if there are no contexts; nullopt
// if its observations do not determine it (Assemble states the limits). Their
// cameras must be those of theta; observations are in the order of keyframe and
// camera.
std::vector<std::optional<Eigen::Vector3d>> TriangulateTracks(
    const Calibration& theta,
    std::span<const KeyframeState> keyframes,
    std::span<const KeyframeContext> contexts,
    std::span<const Track> tracks,
    double pixel_sigma_px,
    double gravity_mps2);

}  // namespace selfcal::client
