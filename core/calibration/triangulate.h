// The place of one landmark from its observations alone, with keyframes and
// calibration held: a function of the present estimate and of nothing that went
// before, so that two ways to one estimate see the same landmarks.
//
// Pure, any thread.
#pragma once

#include <optional>

#include "core/calibration/landmark_place.h"
#include "core/calibration/problem.h"

namespace selfcal {

// A place found by least median of squares over pairs of rays, so that nearly
// half of the observations may be wrong, then refined with a loss that gives
// gross errors no weight. Nothing if no pair of rays gives a point in front of
// the cameras.
std::optional<LandmarkPlace> TriangulateTrack(const LandmarkScene& scene,
                                              const Track& track);

}  // namespace selfcal
