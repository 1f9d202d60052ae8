#include "core/calibration/triangulate.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/model/camera.h"
#include "core/model/median.h"

namespace selfcal {
namespace {

// Rays from which pairs are formed, evenly distributed over the track.
constexpr int kMaxRays = 5;
// Scale of the loss that finds the position among outliers, in robust sigmas.
constexpr double kSearchLossScale = 2.0;
// A point further away than this is represented by its direction alone.
constexpr double kMinInverseDepth = 1e-4;
// If half of the observations are this close to a position, further pairs are
// not tried; only refinement improves it.
constexpr double kEnoughSigmas = 2.0;

struct Ray {
  Eigen::Vector3d center_G;
  Eigen::Vector3d bearing_G;
};

std::vector<Ray> SpreadRays(const LandmarkScene& scene, const Track& track) {
  const int n = static_cast<int>(track.observations.size());
  const int count = std::min(n, kMaxRays);
  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) {
    const int index = count == 1 ? 0 : i * (n - 1) / (count - 1);
    const TrackObservation& seen = track.observations[index];
    Eigen::Vector3d bearing_C;
    if (Unproject(scene.camera(seen), seen.z_px, &bearing_C)) {
      const CameraPose camera = scene.PoseOf(seen);
      const Eigen::Matrix3d R_GC = camera.R_CG.transpose();
      rays.push_back({-(R_GC * camera.p_CG), R_GC * bearing_C});
    }
  }
  return rays;
}

// The point on ray a that is nearest in angle to ray b, homogeneous.
std::optional<Eigen::Vector4d> IntersectRays(const Ray& a, const Ray& b) {
  const Eigen::Vector3d u = b.bearing_G.cross(a.center_G - b.center_G);
  const Eigen::Vector3d v = b.bearing_G.cross(a.bearing_G);
  const double baseline2 = u.squaredNorm();
  if (baseline2 == 0) {
    return std::nullopt;
  }
  const double rho =
      std::clamp(-u.dot(v) / baseline2, kMinInverseDepth, kInverseDepthSigma);
  Eigen::Vector4d point;
  point << rho * a.center_G + a.bearing_G, rho;
  return point;
}

}  // namespace

std::optional<LandmarkPosition> TriangulateTrack(const LandmarkScene& scene,
                                                 const Track& track) {
  const std::vector<Ray> rays = SpreadRays(scene, track);
  double best_px = std::numeric_limits<double>::infinity();
  Eigen::Vector4d best_G = Eigen::Vector4d::UnitZ();
  const double enough_px = kEnoughSigmas * scene.pixel_sigma_px();
  const auto try_pair = [&](const Ray& a, const Ray& b) {
    const auto point_G = IntersectRays(a, b);
    if (!point_G) {
      return;
    }
    const double median_px = UpperMedian(ResidualNorms(scene, track, *point_G));
    if (median_px < best_px) {
      best_px = median_px;
      best_G = *point_G;
    }
  };
  // Pairs furthest apart are tried first.
  const auto count = rays.size();
  for (std::size_t apart = count; apart-- > 1 && best_px > enough_px;) {
    for (std::size_t a = 0; a + apart < count && best_px > enough_px; ++a) {
      try_pair(rays[a], rays[a + apart]);
      try_pair(rays[a + apart], rays[a]);
    }
  }
  if (!std::isfinite(best_px)) {
    return std::nullopt;
  }
  LandmarkPosition position = PositionAt(scene, track, best_G);
  const double robust_sigmas =
      std::max(1.0, best_px / kMedianOfRayleigh / scene.pixel_sigma_px());
  RefinePosition(
      scene,
      track,
      AllOf(track),
      {.kind = LossKind::kCauchy, .scale = kSearchLossScale * robust_sigmas},
      {},
      &position);
  return position;
}

}  // namespace selfcal
