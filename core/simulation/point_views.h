// Pixels, without noise, at which the cameras of a rig observe points when its
// images are exposed.
#pragma once

#include <Eigen/Core>

#include "core/model/calibration.h"
#include "core/simulation/exposures.h"
#include "core/simulation/simulate.h"

namespace selfcal {

bool InsideImage(const CameraCalibration& camera, const Eigen::Vector2d& z_px);

class PointViews {
 public:
  // All must outlive it. The options have the range of depths.
  PointViews(const Calibration& theta,
             const Exposures& exposures,
             const SimulationOptions& options)
      : theta_(theta), exposures_(exposures), options_(options) {}

  int cameras() const { return static_cast<int>(theta_.cameras.size()); }
  const CameraCalibration& camera(int camera) const {
    return theta_.cameras[camera];
  }

  // Computes the pixel of a point in the image of a keyframe. Returns false if
  // the camera does not observe it.
  bool Sees(int camera,
            int keyframe,
            const Eigen::Vector3d& p_G,
            Eigen::Vector2d* z_px) const;
  // Computes the point at a depth along the bearing of a pixel. Returns false
  // if no point projects to the pixel.
  bool PointAt(int camera,
               int keyframe,
               const Eigen::Vector2d& z_px,
               double depth_m,
               Eigen::Vector3d* p_G) const;

 private:
  const Calibration& theta_;
  const Exposures& exposures_;
  const SimulationOptions& options_;
};

}  // namespace selfcal
