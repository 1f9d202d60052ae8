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

// Returns the position of each track in G [m], with the keyframes of the
// segment and theta held constant; nullopt if its observations do not determine
// it (Assemble states the limits). The samples of the segment move the
// keyframes to the exposures; without any, exposures are at the timestamps.
// Their cameras must be those of theta; observations are in the order of
// keyframe and camera.
std::vector<std::optional<Eigen::Vector3d>> TriangulateTracks(
    const Calibration& theta,
    const MotionSegment& segment,
    std::span<const Track> tracks,
    double pixel_sigma_px,
    double gravity_mps2);

}  // namespace selfcal::client
