#include "core/calibration/screening.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "core/model/image_bounds.h"
#include "core/model/median.h"

namespace selfcal {
namespace {

// Observations of a track within the gate of its position, and away from the
// border of the image.
struct Selected {
  std::vector<UsedObservation> used;
  int candidates = 0;  // all but those at the border
};

// Weights of observations by their predicted positions. The last rays are those
// at the reference temperature.
class BorderWeights {
 public:
  BorderWeights(const Calibration& theta, double pixel_sigma_px)
      : theta_(theta), sigma_px_(pixel_sigma_px) {
    for (const CameraCalibration& camera : theta.cameras) {
      rays_end_within_.push_back(!CoversImage(camera, kBorderEnd * sigma_px_));
    }
  }

  double At(int camera, const Eigen::Vector2d& z_px) const {
    const CameraCalibration& of = theta_.cameras[camera];
    const Eigen::Array2d last_px(of.width_px - 1, of.height_px - 1);
    double distance_px = z_px.array().min(last_px - z_px.array()).minCoeff();
    if (rays_end_within_[camera]) {
      distance_px = std::min(
          distance_px, DistanceToLastRay(of, z_px, kBorderEnd * sigma_px_));
    }
    return std::clamp(
        (distance_px / sigma_px_ - kBorderBegin) / (kBorderEnd - kBorderBegin),
        0.0,
        1.0);
  }

 private:
  const Calibration& theta_;
  double sigma_px_;
  std::vector<bool> rays_end_within_;  // within the image of a camera
};

Selected Select(const LandmarkScene& scene,
                const BorderWeights& borders,
                const Track& track,
                const LandmarkPosition& position,
                double gate_px) {
  const Eigen::Vector4d point_G = position.Homogeneous();
  Selected result;
  for (int i = 0; i < static_cast<int>(track.observations.size()); ++i) {
    const TrackObservation& seen = track.observations[i];
    Eigen::Vector2d residual_px;
    const bool projects = scene.Residual(seen, point_G, &residual_px, nullptr);
    if (!projects || residual_px.norm() > gate_px) {
      ++result.candidates;
      continue;
    }
    const double weight = borders.At(seen.camera, seen.z_px + residual_px);
    if (weight > 0) {
      ++result.candidates;
      result.used.push_back({i, weight});
    }
  }
  return result;
}

bool InFull(const std::vector<UsedObservation>& used, const Track& track) {
  return used.size() == track.observations.size() &&
         std::all_of(used.begin(), used.end(), [](const UsedObservation& one) {
           return one.weight == 1;
         });
}

bool EnoughLeft(const Selected& selected) {
  return selected.used.size() >= kMinTrackObservations &&
         static_cast<double>(selected.used.size()) >=
             (1 - kMaxOutlierFraction) * selected.candidates;
}

// Candidate positions of a track.
struct TrackPositions {
  std::optional<LandmarkPosition> found;
  // Its previous position, if that is to be tried as well.
  std::optional<LandmarkPosition> other;
};

// Thresholds for all landmarks.
struct Thresholds {
  RobustLoss loss;
  double max_inverse_depth_sigma;  // [1/m]
};

Thresholds FindThresholds(const LandmarkScene& scene,
                          RobustLoss loss,
                          const CalibrationProblem& problem,
                          const std::vector<TrackPositions>& positions) {
  std::vector<double> norms_px;
  std::vector<double> inverse_depths;
  for (std::size_t t = 0; t < positions.size(); ++t) {
    if (!positions[t].found) {
      continue;
    }
    const LandmarkPosition& position = *positions[t].found;
    for (const double norm :
         ResidualNorms(scene, problem.tracks[t], position.Homogeneous())) {
      if (std::isfinite(norm)) {
        norms_px.push_back(norm);
      }
    }
    inverse_depths.push_back(std::abs(position.inverse_depth.z()));
  }
  const double robust_sigmas = UpperMedian(std::move(norms_px)) /
                               kMedianOfRayleigh / scene.pixel_sigma_px();
  loss.gate =
      std::max(kOutlierGate * std::max(1.0, robust_sigmas), 2 * loss.scale);
  return {loss, kMaxDepthUncertainty * UpperMedian(std::move(inverse_depths))};
}

double InverseDepthSigma(const Eigen::Matrix3d& information) {
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(information);
  const double variance = ldlt.solve(Eigen::Vector3d::UnitZ().eval())(2);
  return ldlt.isPositive() && variance > 0
             ? std::sqrt(variance)
             : std::numeric_limits<double>::infinity();
}

// Position of a landmark at a minimum of its cost.
struct SettledPosition {
  LandmarkPosition position;
  RefinedPosition refined;
};

SettledPosition SettlePosition(const LandmarkScene& scene,
                               const Track& track,
                               const RobustLoss& loss,
                               const LandmarkPosition& start) {
  SettledPosition settled{start, {}};
  settled.refined =
      RefinePosition(scene, track, AllOf(track), loss, {}, &settled.position);
  return settled;
}

// Decides whether a landmark is used, and which of its observations; nullopt if
// it is dropped.
std::optional<ScreenedLandmark> AssessLandmark(const LandmarkScene& scene,
                                               const BorderWeights& borders,
                                               const Track& track,
                                               const Thresholds& thresholds,
                                               const SettledPosition& settled) {
  const double sigma = InverseDepthSigma(settled.refined.information);
  const double weight = 2 * (1 - sigma / thresholds.max_inverse_depth_sigma);
  Selected selected = Select(scene,
                             borders,
                             track,
                             settled.position,
                             thresholds.loss.gate * scene.pixel_sigma_px());
  if (settled.refined.behind || !EnoughLeft(selected) || !(weight > 0)) {
    return std::nullopt;
  }
  return ScreenedLandmark{
      0, settled.position, std::min(weight, 1.0), std::move(selected.used)};
}

Screening Screen(const LandmarkScene& scene,
                 const BorderWeights& borders,
                 const CalibrationProblem& problem,
                 const RobustLoss& loss,
                 const std::vector<TrackPositions>& positions) {
  const Thresholds thresholds = FindThresholds(scene, loss, problem, positions);

  Screening result;
  result.loss = thresholds.loss;
  for (std::size_t t = 0; t < positions.size(); ++t) {
    const Track& track = problem.tracks[t];
    const auto observed = static_cast<int>(track.observations.size());
    std::optional<ScreenedLandmark> landmark;
    if (positions[t].found) {
      SettledPosition settled =
          SettlePosition(scene, track, thresholds.loss, *positions[t].found);
      if (positions[t].other) {
        SettledPosition other =
            SettlePosition(scene, track, thresholds.loss, *positions[t].other);
        if (other.refined.cost < settled.refined.cost) settled = other;
      }
      landmark = AssessLandmark(scene, borders, track, thresholds, settled);
    }
    if (!landmark) {
      ++result.landmarks_dropped;
      result.observations_dropped += observed;
      continue;
    }
    landmark->track = static_cast<int>(t);
    const auto used = static_cast<int>(landmark->used.size());
    result.observations += used;
    result.observations_dropped += observed - used;
    result.landmarks.push_back(std::move(*landmark));
  }
  return result;
}

// No weight of a landmark may increase, and no dropped landmark may return.
void LimitWeights(const CalibrationProblem& problem,
                  const Screening& before,
                  Screening* now) {
  std::vector<double> weights(problem.tracks.size(), 0);
  for (const ScreenedLandmark& landmark : before.landmarks) {
    weights[landmark.track] = landmark.weight;
  }
  const auto back = [&](const ScreenedLandmark& landmark) {
    return weights[landmark.track] == 0;
  };
  for (ScreenedLandmark& landmark : now->landmarks) {
    landmark.weight = std::min(landmark.weight, weights[landmark.track]);
    if (!back(landmark)) continue;
    const auto used = static_cast<int>(landmark.used.size());
    ++now->landmarks_dropped;
    now->observations -= used;
    now->observations_dropped += used;
  }
  std::erase_if(now->landmarks, back);
}

// Previous position of a track, with a new anchor; it is the position found if
// the whole track lies within the gate there.
TrackPositions PositionsBefore(const LandmarkScene& scene,
                               const Track& track,
                               const LandmarkPosition& before,
                               double gate_px,
                               bool keep_other) {
  const Eigen::Vector4d point_G = before.Homogeneous();
  const std::vector<double> norms_px = ResidualNorms(scene, track, point_G);
  TrackPositions positions;
  if (*std::max_element(norms_px.begin(), norms_px.end()) <= gate_px) {
    positions.found = PositionAt(scene, track, point_G);
  } else if (keep_other) {
    positions.other = PositionAt(scene, track, point_G);
  }
  return positions;
}

}  // namespace

void ScaleWeights(double factor, std::vector<ScreenedLandmark>* landmarks) {
  for (ScreenedLandmark& landmark : *landmarks) landmark.weight *= factor;
}

void SetTrackNoise(double factor, Screening* screening) {
  const double ratio = screening->track_noise_factor / factor;
  ScaleWeights(ratio * ratio, &screening->landmarks);
  screening->track_noise_factor = factor;
}

Screening ScreenLandmarks(const Rig& rig,
                          const Calibration& theta,
                          const CalibrationProblem& problem,
                          const std::vector<KeyframeState>& keyframes,
                          const KeyframeMotions& motions,
                          const RobustLoss& loss,
                          const Screening* before) {
  const LandmarkScene scene(
      ChainThetas(theta, problem), keyframes, motions, rig.pixel_sigma_px);
  std::vector<TrackPositions> positions(problem.tracks.size());
  const int screenings = before != nullptr ? before->screenings + 1 : 1;
  const bool settle = screenings > kFreeScreenings;
  if (before != nullptr) {
    for (const ScreenedLandmark& landmark : before->landmarks) {
      positions[landmark.track] =
          PositionsBefore(scene,
                          problem.tracks[landmark.track],
                          landmark.position,
                          before->loss.gate * rig.pixel_sigma_px,
                          settle);
    }
  }
  for (std::size_t t = 0; t < positions.size(); ++t) {
    const Track& track = problem.tracks[t];
    if (!positions[t].found &&
        track.observations.size() >= kMinTrackObservations) {
      positions[t].found = TriangulateTrack(scene, track);
    }
  }
  Screening result = Screen(scene,
                            BorderWeights(theta, rig.pixel_sigma_px),
                            problem,
                            loss,
                            positions);
  result.screenings = screenings;
  if (before != nullptr) {
    SetTrackNoise(before->track_noise_factor, &result);
  }
  if (settle) {
    LimitWeights(problem, *before, &result);
  }
  return result;
}

void RefineOnWhatIsUsed(const Rig& rig,
                        const Calibration& theta,
                        const CalibrationProblem& problem,
                        const std::vector<KeyframeState>& keyframes,
                        const KeyframeMotions& motions,
                        Screening* screening) {
  const LandmarkScene scene(
      ChainThetas(theta, problem), keyframes, motions, rig.pixel_sigma_px);
  for (ScreenedLandmark& landmark : screening->landmarks) {
    const Track& track = problem.tracks[landmark.track];
    if (!InFull(landmark.used, track)) {
      RefinePosition(
          scene, track, landmark.used, screening->loss, {}, &landmark.position);
    }
  }
}

ReprojectionStatistics MeasureReprojection(
    const Rig& rig,
    const Calibration& theta,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes,
    const KeyframeMotions& motions,
    const std::vector<ScreenedLandmark>& landmarks) {
  const LandmarkScene scene(
      ChainThetas(theta, problem), keyframes, motions, rig.pixel_sigma_px);
  std::vector<double> projected_px;
  double sum_of_squares = 0;
  int used = 0;
  for (const ScreenedLandmark& landmark : landmarks) {
    const std::vector<double> norms = ResidualNorms(
        scene, problem.tracks[landmark.track], landmark.position.Homogeneous());
    std::copy_if(norms.begin(),
                 norms.end(),
                 std::back_inserter(projected_px),
                 [](double norm) { return std::isfinite(norm); });
    for (const UsedObservation& one : landmark.used) {
      const double norm = norms[one.index];
      if (std::isfinite(norm)) {
        sum_of_squares += norm * norm;
        ++used;
      }
    }
  }
  return {used > 0 ? std::sqrt(sum_of_squares / used) : 0,
          UpperMedian(std::move(projected_px))};
}

}  // namespace selfcal
