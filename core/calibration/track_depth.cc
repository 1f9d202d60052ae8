#include "core/calibration/track_depth.h"

#include <cstddef>

#include "core/calibration/screening.h"
#include "core/model/camera.h"
#include "core/model/median.h"

namespace selfcal {
namespace {

// The information of a track about the inverse depth of its landmark, along its
// ray from the centre of the cameras that observe it.
struct InverseDepth {
  double value = 0;        // [1/m]
  double information = 0;  // [m^2]
};

// A camera at a distance b from the others across the ray observes a point of
// inverse depth rho rotated by b rho. The error is assumed to be one pixel, so
// that the connections do not depend on the estimated noise. scales_px are
// those of the cameras [px/rad].
InverseDepth Predict(const Rig& rig,
                     std::span<const double> scales_px,
                     std::span<const KeyframeState> keyframes,
                     const Track& track,
                     const Eigen::Vector3d& landmark_G) {
  const auto position_G = [&](const TrackObservation& seen) {
    const KeyframeState& x = keyframes[seen.keyframe];
    const CameraCalibration& camera = rig.factory.cameras[seen.camera];
    return Eigen::Vector3d(x.p_GI -
                           x.q_GI * (camera.q_CI.conjugate() * camera.p_CI));
  };
  Eigen::Vector3d middle_G = Eigen::Vector3d::Zero();
  for (const TrackObservation& seen : track.observations) {
    middle_G += position_G(seen);
  }
  middle_G /= static_cast<double>(track.observations.size());
  const Eigen::Vector3d ray_G = landmark_G - middle_G;
  const double distance_m = ray_G.norm();
  if (!(distance_m > 0)) return {};
  InverseDepth result{1 / distance_m, 0};
  for (const TrackObservation& seen : track.observations) {
    const double across_m =
        (position_G(seen) - middle_G).cross(ray_G).norm() / distance_m;
    const double px_m = scales_px[seen.camera] * across_m;
    result.information += px_m * px_m;
  }
  return result;
}

}  // namespace

std::vector<bool> TracksWithDepth(
    const Rig& rig,
    std::span<const KeyframeState> keyframes,
    std::span<const Track> tracks,
    std::span<const Eigen::Vector3d> landmarks_G) {
  std::vector<double> scales_px;
  for (const CameraCalibration& camera : rig.factory.cameras) {
    scales_px.push_back(PixelsPerRadian(camera).minCoeff());
  }
  std::vector<InverseDepth> depths;
  std::vector<double> values;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    depths.push_back(
        Predict(rig, scales_px, keyframes, tracks[t], landmarks_G[t]));
    values.push_back(depths.back().value);
  }
  std::vector<bool> with_depth;
  if (tracks.empty()) return with_depth;
  const double sigma = kMaxDepthUncertainty * UpperMedian(values);
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    with_depth.push_back(tracks[t].observations.size() >=
                             kMinTrackObservations &&
                         depths[t].information * sigma * sigma > 1);
  }
  return with_depth;
}

}  // namespace selfcal
