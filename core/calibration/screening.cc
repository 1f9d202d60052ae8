#include "core/calibration/screening.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
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
  return static_cast<int>(used.size()) >= kMinTrackObservations &&
         static_cast<double>(used.size()) >= (1 - kMaxOutlierFraction) * n;
}

bool DepthIsKnown(const Eigen::Matrix3d& information, double rho) {
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(information);
  if (!(rho > 0) || ldlt.info() != Eigen::Success ||
      !(ldlt.vectorD().minCoeff() > 0)) {
    return false;
  }
  const double variance = ldlt.solve(Eigen::Vector3d::UnitZ().eval())(2);
  return variance > 0 && std::sqrt(variance) <= kMaxDepthUncertainty * rho;
}

// Settles one landmark: which observations are within the gate of the place
// that those within the gate give.
std::optional<ScreenedLandmark> Settle(const LandmarkScene& scene,
                                       const Track& track,
                                       const CalibrateOptions& options,
                                       double gate_px,
                                       LandmarkPlace place) {
  ScreenedLandmark landmark;
  landmark.used =
      Within(ResidualNorms(scene, track, place.Homogeneous()), gate_px);
  Eigen::Matrix3d information;
  for (int pass = 0; pass < 2; ++pass) {
    if (!EnoughLeft(landmark.used, track)) {
      return std::nullopt;
    }
    information = RefinePlace(
        scene, track, landmark.used, options.loss, options.loss_scale, &place);
    std::vector<int> used =
        Within(ResidualNorms(scene, track, place.Homogeneous()), gate_px);
    if (used == landmark.used) {
      break;
    }
    landmark.used = std::move(used);
  }
  if (!EnoughLeft(landmark.used, track) ||
      !DepthIsKnown(information, place.inverse_depth.z())) {
    return std::nullopt;
  }
  landmark.place = place;
  return landmark;
}

}  // namespace

Screening ScreenLandmarks(const Rig& rig,
                          const Calibration& theta,
                          const CalibrationProblem& problem,
                          const std::vector<KeyframeState>& keyframes,
                          const CalibrateOptions& options) {
  const LandmarkScene scene{theta, keyframes, rig.pixel_sigma_px};
  std::vector<std::optional<LandmarkPlace>> places(problem.tracks.size());
  std::vector<double> norms_px;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    const Track& track = problem.tracks[t];
    if (static_cast<int>(track.observations.size()) < kMinTrackObservations) {
      continue;
    }
    places[t] = TriangulateTrack(scene, track);
    if (places[t]) {
      for (const double norm :
           ResidualNorms(scene, track, places[t]->Homogeneous())) {
        if (std::isfinite(norm)) {
          norms_px.push_back(norm);
        }
      }
    }
  }

  Screening result;
  const double gate_px =
      kOutlierGate * std::max(rig.pixel_sigma_px,
                              Median(std::move(norms_px)) / kMedianOfRayleigh);
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    const Track& track = problem.tracks[t];
    std::optional<ScreenedLandmark> landmark;
    if (places[t]) {
      landmark = Settle(scene, track, options, gate_px, *places[t]);
    }
    const int observed = static_cast<int>(track.observations.size());
    if (!landmark) {
      ++result.landmarks_dropped;
      result.observations_dropped += observed;
      continue;
    }
    landmark->track = static_cast<int>(t);
    const int used = static_cast<int>(landmark->used.size());
    result.observations += used;
    result.observations_dropped += observed - used;
    result.landmarks.push_back(std::move(*landmark));
  }
  return result;
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
