#include "client/selfcal/track_positions.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/calibration/landmark_position.h"
#include "core/calibration/triangulate.h"
#include "core/factor/keyframe_motion.h"
#include "core/model/median.h"
#include "core/model/rig.h"
#include "core/model/temperature.h"

namespace selfcal::client {
namespace {

// Largest standard deviation of the inverse depth, relative to it.
constexpr double kMaxRelativeSigma = 0.25;
// Largest median of the residuals, in sigmas of a pixel: the states of a SLAM
// system and its calibration have errors, too.
constexpr double kMaxMedianSigmas = 10;

std::optional<Eigen::Vector3d> TriangulateOne(const LandmarkScene& scene,
                                              const Track& track) {
  if (track.observations.size() < 2) return std::nullopt;
  auto position = TriangulateTrack(scene, track);
  if (!position) return std::nullopt;
  const double median_px =
      UpperMedian(ResidualNorms(scene, track, position->Homogeneous()));
  const double sigmas = median_px / scene.pixel_sigma_px();
  if (!(sigmas <= kMaxMedianSigmas)) return std::nullopt;
  const Eigen::Matrix3d information =
      RefinePosition(scene, track, AllOf(track), {}, {.steps = 0}, &*position)
          .information;
  const double variance =
      information.ldlt().solve(Eigen::Vector3d::UnitZ().eval()).z();
  const double rho = position->inverse_depth.z();
  const double sigma =
      std::sqrt(variance) * std::max(1.0, sigmas / kMedianOfRayleigh);
  const Eigen::Vector3d point_G = position->Point();
  // The comparison is false for NaN.
  if (!(rho > 0 && sigma <= kMaxRelativeSigma * rho)) return std::nullopt;
  return point_G.allFinite() ? std::optional(point_G) : std::nullopt;
}

}  // namespace

std::vector<std::optional<Eigen::Vector3d>> TriangulateTracks(
    const Calibration& theta,
    const MotionSegment& segment,
    std::span<const Track> tracks,
    double pixel_sigma_px,
    double gravity_mps2) {
  Rig rig;
  rig.gravity_mps2 = gravity_mps2;
  const SegmentTheta theta_s(theta, segment);
  KeyframeMotions motions;
  if (!segment.imu.empty()) {
    motions.Measure(rig,
                    *theta_s,
                    std::vector<char>(theta.cameras.size(), 0),
                    segment.keyframes,
                    [&](std::size_t k) { return ContextOf(segment, k); });
  }
  const LandmarkScene scene(
      *theta_s, segment.keyframes, motions, pixel_sigma_px);
  std::vector<std::optional<Eigen::Vector3d>> positions;
  positions.reserve(tracks.size());
  for (const Track& track : tracks) {
    positions.push_back(TriangulateOne(scene, track));
  }
  return positions;
}

}  // namespace selfcal::client
