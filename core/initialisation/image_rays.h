// The points of tracked images as rays, for a focal length that is to be
// estimated, and pairs of images with the points that both have. Internal to
// core/initialisation.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/initialisation/rotation_start.h"
#include "core/model/camera.h"

namespace selfcal {

struct ImagePoint {
  std::uint64_t landmark;
  Eigen::Vector2d z_px;
  Eigen::Vector3d ray_C;     // unit; zero if the pixel has none
  Eigen::Vector3d by_scale;  // derivative by the logarithm of the focal scale
};

struct RayImage {
  double t_s;                      // since the origin, on the camera's clock
  std::vector<ImagePoint> points;  // in order of landmarks, one of each
};

// Images that are not later than the one before are left out, and so are
// points that are not finite.
class RayImages {
 public:
  RayImages(const CameraCalibration& camera,
            std::span<const TrackedImage> images,
            std::int64_t origin_ns);

  // Computes the rays for f times `scale`.
  void SetFocalScale(double scale);

  // Moves each pixel by an error of this standard deviation on each axis; the
  // same one of the opposite sign for a negative sigma.
  void AddNoise(double sigma_px, std::uint64_t seed);

  const std::vector<RayImage>& images() const { return images_; }
  const CameraCalibration& camera() const { return camera_; }
  // Includes the focal scale [px/rad].
  double px_per_rad() const;

 private:
  const CameraCalibration start_;
  CameraCalibration camera_;
  double focal_scale_ = 1;
  std::vector<RayImage> images_;
};

struct ImagePair {
  int from;
  int to;
  std::vector<std::pair<int, int>> matches;  // points of either image
};

// A pair with fewer matches is not used.
inline constexpr int kMinMatches = 12;

// A chain of pairs, each from where the last one ends: over as many images as
// lie within the interval, and further until points have moved by the flow, as
// long as half of the points are common; or at least the next one. Long chains
// are thinned out evenly to kMaxPairs.
inline constexpr std::size_t kMaxPairs = 3000;
std::vector<ImagePair> ChainPairs(const std::vector<RayImage>& images,
                                  double interval_s,
                                  double flow_rad = 0);

}  // namespace selfcal
