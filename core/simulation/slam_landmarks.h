// Landmarks as a SLAM system would triangulate them: from its measured pixels,
// its own poses at the exposures and its own calibration.
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

// The point in G of each landmark of `tracks`; empty where there is none to
// hand over: too few observations, or not consistent with most of them.
//
// Minimises the robust reprojection error over all observations of the session
// together with what a map knows of the distance from the camera that saw the
// landmark first (true up to slam_landmark_relative, trusted to 10 %): without
// parallax, as at rest, that alone gives the depth.
std::vector<std::optional<Eigen::Vector3d>> TriangulateLandmarks(
    const Calibration& theta_slam,
    const Exposures& slam_exposures,
    const FeatureTracks& tracks,
    double pixel_sigma_px,
    const SimulationOptions& options);

}  // namespace selfcal
