// Triangulates one landmark from its observations alone, with keyframes and
// calibration held constant: a function of the current estimate and not of its
// history, so that two paths to one estimate have the same landmarks.
//
// Pure, callable from any thread.
#pragma once

#include <optional>

#include "core/calibration/landmark_position.h"
#include "core/calibration/problem.h"

namespace selfcal {

// Finds a position by least median of squares over pairs of rays, so that
// nearly half of the observations may be outliers, and refines it with a loss
// that gives gross errors no weight. Returns nullopt if no pair of rays gives a
// point in front of the cameras.
std::optional<LandmarkPosition> TriangulateTrack(const LandmarkScene& scene,
                                                 const Track& track);

}  // namespace selfcal
