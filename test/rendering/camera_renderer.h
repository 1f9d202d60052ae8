// Images of a scene as a camera on a moving body sees them, without the sensor:
// the mean radiance of each pixel over its area and its exposure.
//
// Every pixel is the mean of a few rays, spread over its area and over the
// exposure; each ray reads the texture at the level of detail of its own
// footprint, so that neither edges nor texture alias. The pose is that of the
// ray's own time, of each row if the shutter rolls.
//
// Immutable once made; Render may be called from any thread. The same arguments
// give the same bits: single precision, in a fixed order, without fused
// products.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/model/camera.h"
#include "core/simulation/trajectory.h"
#include "test/rendering/scene.h"

namespace selfcal {

class CameraRenderer {
 public:
  explicit CameraRenderer(const CameraCalibration& camera);

  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }

  // Fills *radiance, row by row, with values in [0, 1]: the texture's value
  // times the brightness of the face. Pixels to which no point projects are 0.
  // t_s is the middle of the exposure of row 0 on the clock of the trajectory,
  // which must cover all exposures; those of the other rows of a rolling
  // shutter follow by the line delay of the camera.
  void Render(const Scene& scene,
              const Trajectory& trajectory,
              double t_s,
              double exposure_s,
              std::vector<float>* radiance) const;

  // Number of rays for each pixel: more for a motion that blurs, about one for
  // each pixel of the blur of a point at a distance of 1 m.
  int RaysPerPixel(const Trajectory& trajectory,
                   double t_s,
                   double exposure_s) const;

 private:
  static constexpr int kPattern = 4;  // places of rays within a pixel

  // Unit rays in C, for each pixel of the padded rows.
  struct Rays {
    std::vector<float> x, y, z;
  };
  // Cone about the rays of the pixels of a row that are cast together.
  struct Cone {
    Eigen::Vector3f axis = Eigen::Vector3f::Zero();
    float cosine = 1;
    float sine = 0;
    bool empty = true;
  };
  struct Solid;

  void CacheRays(const CameraCalibration& camera);
  void CacheCones();
  // The surfaces of the scene as the camera sees them at one instant.
  void Place(const Scene& scene,
             const BodyMotion& motion,
             double t_s,
             std::vector<Solid>* solids) const;
  // Adds one ray of each pixel of a row to its sum.
  void AddRow(const Texture& texture,
              const std::vector<Solid>& solids,
              int row,
              int place,
              float level_shift,
              float* sums) const;

  Eigen::Quaterniond q_CI_;
  Eigen::Vector3d p_CI_;
  int width_px_;
  int height_px_;
  int tiles_;  // of a row
  double line_delay_s_;
  double px_per_rad_;
  Rays rays_[kPattern];
  std::vector<float> angle_;  // that a ray of a pixel stands for [rad]; 0: none
  std::vector<Cone> cones_;
};

}  // namespace selfcal
