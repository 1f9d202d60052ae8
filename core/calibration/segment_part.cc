#include "core/calibration/segment_part.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/calibration/chain_thetas.h"
#include "core/calibration/landmark_position.h"
#include "core/calibration/theta_information.h"

namespace selfcal {
namespace {

constexpr std::size_t kLeastObservations = 2;

// The problem of one segment, without tracks.
CalibrationProblem ProblemOf(const CalibrationProblem& all,
                             const std::vector<KeyframeState>& keyframes,
                             const KeyframeRange& range) {
  CalibrationProblem problem;
  const auto first = static_cast<std::ptrdiff_t>(range.first);
  const auto end = first + range.count;
  problem.keyframes.assign(keyframes.begin() + first, keyframes.begin() + end);
  problem.contexts.assign(all.contexts.begin() + first,
                          all.contexts.begin() + end);
  problem.gauge_keyframes = {0};
  problem.chain_starts = {0};
  const auto chain =
      std::upper_bound(
          all.chain_starts.begin(), all.chain_starts.end(), range.first) -
      all.chain_starts.begin() - 1;
  problem.chain_temperatures_c = {all.chain_temperatures_c[chain]};
  for (const InertialLink& link : all.inertial_links) {
    if (!range.Contains(link.before) || !range.Contains(link.after)) continue;
    problem.inertial_links.push_back({link.before - range.first,
                                      link.after - range.first,
                                      link.samples,
                                      link.imu});
  }
  return problem;
}

// Adds the tracks of the landmarks as far as the segment observes them.
// Returns the landmarks, with their weights.
std::vector<ScreenedLandmark> TakeLandmarks(const CalibrationProblem& all,
                                            const Screening& screening,
                                            const KeyframeRange& range,
                                            CalibrationProblem* problem) {
  std::vector<ScreenedLandmark> landmarks;
  for (const ScreenedLandmark& landmark : screening.landmarks) {
    const Track& track = all.tracks[landmark.track];
    Track part = {.id = track.id};
    ScreenedLandmark taken = {.track = static_cast<int>(problem->tracks.size()),
                              .position = landmark.position,
                              .weight = landmark.weight,
                              .used = {}};
    for (const UsedObservation& used : landmark.used) {
      TrackObservation seen = track.observations[used.index];
      if (!range.Contains(seen.keyframe)) continue;
      seen.keyframe -= range.first;
      taken.used.push_back(
          {static_cast<int>(part.observations.size()), used.weight});
      part.observations.push_back(seen);
    }
    if (part.observations.size() < kLeastObservations) continue;
    problem->tracks.push_back(std::move(part));
    landmarks.push_back(std::move(taken));
  }
  return landmarks;
}

// Sums over the used observations.
struct ResidualSums {
  double squares_px2 = 0;
  int observations = 0;
  double weight = 0, curvature = 0;  // of the loss
};

ResidualSums SumResiduals(const LandmarkScene& scene,
                          const CalibrationProblem& problem,
                          const std::vector<ScreenedLandmark>& landmarks,
                          const RobustLoss& loss) {
  ResidualSums sums;
  for (const ScreenedLandmark& landmark : landmarks) {
    const std::vector<double> norms_px = ResidualNorms(
        scene, problem.tracks[landmark.track], landmark.position.Homogeneous());
    for (const UsedObservation& used : landmark.used) {
      const double square_px2 = norms_px[used.index] * norms_px[used.index];
      if (!std::isfinite(square_px2)) continue;
      const double s =
          square_px2 / (scene.pixel_sigma_px() * scene.pixel_sigma_px());
      const double share = landmark.weight * used.weight;
      sums.squares_px2 += square_px2;
      ++sums.observations;
      sums.weight += share * loss.Weight(s);
      sums.curvature += share * loss.Curvature(s);
    }
  }
  return sums;
}

}  // namespace

SegmentPart LineariseSegmentPart(const WorkingPoint& point,
                                 const KeyframeRange& range) {
  const Rig& rig = point.rig();
  const Calibration theta = point.theta();
  CalibrationProblem problem =
      ProblemOf(point.problem(), point.estimate().keyframes, range);
  const std::vector<ScreenedLandmark> landmarks =
      TakeLandmarks(point.problem(), point.screening(), range, &problem);
  KeyframeMotions motions;
  MeasureMotions(rig, theta, problem, problem.keyframes, &motions);
  const std::vector<InertialMatrix> whitening = WhitenInertialLinks(
      rig, ChainThetas(theta, problem), problem, problem.keyframes);
  const Eigen::Index size = TangentSize(theta);
  const Eigen::MatrixXd held(size, 0);
  const CalibrationEstimate estimate{Eigen::VectorXd::Zero(size),
                                     problem.keyframes};
  const RobustLoss& loss = point.screening().loss;
  const SolverRound round = {.rig = rig,
                             .reference = theta,
                             .problem = problem,
                             .motions = motions,
                             .whitening = whitening,
                             .basis = held,
                             .loss = loss};
  const ResidualSums sums =
      SumResiduals(LandmarkScene(ChainThetas(theta, problem),
                                 problem.keyframes,
                                 motions,
                                 rig.pixel_sigma_px),
                   problem,
                   landmarks,
                   loss);
  SegmentPart part;
  if (sums.observations > 0) {
    part.reprojection_rms_px = std::sqrt(sums.squares_px2 / sums.observations);
  }
  LinearisedRound linearised;
  if (sums.curvature > 0 &&
      LineariseFactors(round, estimate, landmarks, &loss, &linearised)) {
    part.theta = linearised.system.information();
    part.theta.eta *= sums.weight / sums.curvature;
  } else {
    part.theta.Lambda.setZero(size, size);
    part.theta.eta.setZero(size);
  }
  if (!problem.inertial_links.empty()) {
    part.inertial_rms =
        std::sqrt(2 * RoundCost(round, estimate, {}) /
                  static_cast<double>(problem.inertial_links.size()));
  }
  return part;
}

}  // namespace selfcal
