// Errors of the pixels of tracks, as those of a feature tracker: correlated
// along a track, with a part that is common to it, and due to motion blur.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/simulation/point_views.h"
#include "core/simulation/random.h"
#include "core/simulation/simulate.h"

namespace selfcal {

class PixelErrors {
 public:
  // The options must outlive it.
  PixelErrors(double pixel_sigma_px,
              int cameras,
              const SimulationOptions& options);

  // Error of the next pixel of the track of a landmark in a camera: a
  // first-order autoregressive process, and what is common to the track
  // (SimulationOptions::pixel_shared).
  Eigen::Vector2d Next(int camera,
                       int landmark,
                       int keyframe,
                       bool is_first_of_landmark);

 private:
  // Errors of a track in one camera, in sigmas.
  struct Track {
    int keyframe = -2;  // of the last observation
    Eigen::Vector2d drift = Eigen::Vector2d::Zero();
    Eigen::Vector2d common = Eigen::Vector2d::Zero();
    double scale = 1;
  };

  Eigen::Vector2d InSigmas(Track* track,
                           int keyframe,
                           bool is_first_of_landmark);
  // Draws the common part of the errors of a new track.
  void DrawPatch(Track* track);

  const SimulationOptions& options_;
  const double pixel_sigma_px_;
  Random noise_;
  Random patches_;
  std::vector<std::vector<Track>> tracks_;  // by camera and landmark
};

class BlurErrors {
 public:
  // All must outlive it; `closed` is needed only with options.exposure_s > 0.
  BlurErrors(const PointViews& closed, const SimulationOptions& options);

  // Error of the pixel z_px of a point that moves in the image during the
  // exposure, along its motion. A point that leaves the image meanwhile is not
  // blurred.
  Eigen::Vector2d Next(int camera,
                       int keyframe,
                       const Eigen::Vector3d& p_G,
                       const Eigen::Vector2d& z_px);

 private:
  PointViews closed_;  // when the shutter closes
  const SimulationOptions& options_;
  Random random_;
};

}  // namespace selfcal
