#include "core/calibration/screening.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

namespace selfcal {
namespace {

constexpr double kMedianOfRayleigh = 1.1774100225154747;

double Median(std::vector<double> values) {
  if (values.empty()) {
    return 0;
  }
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<int> Within(const std::vector<double>& norms_px, double gate_px) {
  std::vector<int> indices;
  for (int i = 0; i < static_cast<int>(norms_px.size()); ++i) {
    if (norms_px[i] <= gate_px) {
      indices.push_back(i);
    }
  }
  return indices;
}

bool EnoughLeft(const std::vector<int>& used, const Track& track) {
  const auto n = static_cast<double>(track.observations.size());
  return used.size() >= kMinTrackObservations &&
         static_cast<double>(used.size()) >= (1 - kMaxOutlierFraction) * n;
}

// What all landmarks are judged by.
struct Thresholds {
  RobustLoss loss;
  double max_inverse_depth_sigma;  // [1/m]
};

Thresholds FindThresholds(
    const LandmarkScene& scene,
    const CalibrateOptions& options,
    const CalibrationProblem& problem,
    const std::vector<std::optional<LandmarkPlace>>& places) {
  std::vector<double> norms_px;
  std::vector<double> inverse_depths;
  for (std::size_t t = 0; t < places.size(); ++t) {
    if (!places[t]) {
      continue;
    }
    for (const double norm :
         ResidualNorms(scene, problem.tracks[t], places[t]->Homogeneous())) {
      if (std::isfinite(norm)) {
        norms_px.push_back(norm);
      }
    }
    inverse_depths.push_back(std::abs(places[t]->inverse_depth.z()));
  }
  const double robust_sigmas =
      Median(std::move(norms_px)) / kMedianOfRayleigh / scene.pixel_sigma_px;
  return {{.kind = options.loss,
           .scale = options.loss_scale,
           .gate = std::max(kOutlierGate * std::max(1.0, robust_sigmas),
                            2 * options.loss_scale)},
          kMaxDepthUncertainty * Median(std::move(inverse_depths))};
}

double InverseDepthSigma(const Eigen::Matrix3d& information) {
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(information);
  const double variance = ldlt.solve(Eigen::Vector3d::UnitZ().eval())(2);
  return ldlt.isPositive() && variance > 0
             ? std::sqrt(variance)
             : std::numeric_limits<double>::infinity();
}

// Settles one landmark: which observations are within the gate of the place
// that those within the gate give.
std::optional<ScreenedLandmark> Settle(const LandmarkScene& scene,
                                       const Track& track,
                                       const Thresholds& thresholds,
                                       LandmarkPlace place) {
  const auto within_gate = [&] {
    return Within(ResidualNorms(scene, track, place.Homogeneous()),
                  thresholds.loss.gate * scene.pixel_sigma_px);
  };
  std::vector<int> used = within_gate();
  double sigma = 0;
  for (int pass = 0; pass < 2; ++pass) {
    if (!EnoughLeft(used, track)) {
      return std::nullopt;
    }
    sigma = InverseDepthSigma(
        RefinePlace(scene, track, used, thresholds.loss, &place));
    used = within_gate();
  }
  if (!EnoughLeft(used, track) ||
      !(sigma <= thresholds.max_inverse_depth_sigma)) {
    return std::nullopt;
  }
  return ScreenedLandmark{0, place, std::move(used)};
}

}  // namespace

Screening ScreenLandmarks(const Rig& rig,
                          const Calibration& theta,
                          const CalibrationProblem& problem,
                          const std::vector<KeyframeState>& keyframes,
                          const CalibrateOptions& options) {
  const LandmarkScene scene{theta, keyframes, rig.pixel_sigma_px};
  std::vector<std::optional<LandmarkPlace>> places(problem.tracks.size());
  for (std::size_t t = 0; t < places.size(); ++t) {
    if (problem.tracks[t].observations.size() >= kMinTrackObservations) {
      places[t] = TriangulateTrack(scene, problem.tracks[t]);
    }
  }
  const Thresholds thresholds = FindThresholds(scene, options, problem, places);

  Screening result;
  result.loss = thresholds.loss;
  for (std::size_t t = 0; t < places.size(); ++t) {
    const Track& track = problem.tracks[t];
    const auto observed = static_cast<int>(track.observations.size());
    std::optional<ScreenedLandmark> landmark;
    if (places[t]) {
      landmark = Settle(scene, track, thresholds, *places[t]);
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

void KeepCommonLandmarks(const Screening& before, Screening* screening) {
  // Both lists are in the order of the tracks.
  const auto had = [&](const ScreenedLandmark& landmark) {
    return std::binary_search(
        before.landmarks.begin(),
        before.landmarks.end(),
        landmark,
        [](const auto& a, const auto& b) { return a.track < b.track; });
  };
  std::erase_if(screening->landmarks, [&](const ScreenedLandmark& landmark) {
    if (had(landmark)) {
      return false;
    }
    const auto used = static_cast<int>(landmark.used.size());
    ++screening->landmarks_dropped;
    screening->observations -= used;
    screening->observations_dropped += used;
    return true;
  });
}

ReprojectionStatistics MeasureReprojection(
    const Rig& rig,
    const Calibration& theta,
    const CalibrationProblem& problem,
    const std::vector<KeyframeState>& keyframes,
    const std::vector<ScreenedLandmark>& landmarks) {
  const LandmarkScene scene{theta, keyframes, rig.pixel_sigma_px};
  std::vector<double> projected_px;
  double sum_of_squares = 0;
  int used = 0;
  for (const ScreenedLandmark& landmark : landmarks) {
    const std::vector<double> norms = ResidualNorms(
        scene, problem.tracks[landmark.track], landmark.place.Homogeneous());
    std::copy_if(norms.begin(),
                 norms.end(),
                 std::back_inserter(projected_px),
                 [](double norm) { return std::isfinite(norm); });
    for (const int index : landmark.used) {
      if (std::isfinite(norms[index])) {
        sum_of_squares += norms[index] * norms[index];
        ++used;
      }
    }
  }
  return {used > 0 ? std::sqrt(sum_of_squares / used) : 0,
          Median(std::move(projected_px))};
}

}  // namespace selfcal
