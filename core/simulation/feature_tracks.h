// Observations of the cameras of a rig during a session: landmarks around the
// motion, and tracks that start and end like those of a feature tracker.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "core/simulation/exposures.h"
#include "core/simulation/simulate.h"

namespace selfcal {

struct FeatureObservation {
  int keyframe = 0;  // of the session
  int camera = 0;
  int landmark = 0;  // index into FeatureTracks::landmarks_G
  Eigen::Vector2d true_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d measured_px = Eigen::Vector2d::Zero();
};

struct FeatureTracks {
  std::vector<Eigen::Vector3d> landmarks_G;      // truth [m]
  std::vector<FeatureObservation> observations;  // in order of the keyframes
};

// Simulates tracks over this many keyframes, given their true exposures;
// `closed` are those at the closing of the shutter, needed only with
// options.exposure_s > 0. Every pixel, true and measured, lies inside the
// image.
FeatureTracks SimulateTracks(const Calibration& theta,
                             double pixel_sigma_px,
                             int keyframes,
                             const Exposures& exposures,
                             const SimulationOptions& options,
                             const Exposures& closed = {});

}  // namespace selfcal
