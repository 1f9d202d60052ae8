// Triangulates landmarks as a SLAM system would: from its measured pixels, its
// own poses at the exposures and its own calibration.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "core/simulation/exposures.h"
#include "core/simulation/feature_tracks.h"
#include "core/simulation/simulate.h"

namespace selfcal {

// Returns the point in G of each landmark of `tracks`; nullopt if there is
// none: too few observations, or not consistent with most of them.
//
// Minimises the robust reprojection error over all observations of the session,
// with a prior of the map on the distance from the camera that observed the
// landmark first (true up to slam_landmark_relative, weighted with 10 %):
// without parallax, as at rest, only the prior determines the depth.
std::vector<std::optional<Eigen::Vector3d>> TriangulateLandmarks(
    const Calibration& theta_slam,
    const Exposures& slam_exposures,
    const FeatureTracks& tracks,
    double pixel_sigma_px,
    const SimulationOptions& options);

}  // namespace selfcal
