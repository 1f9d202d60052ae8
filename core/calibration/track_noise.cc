#include "core/calibration/track_noise.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>

#include "core/calibration/chain_thetas.h"
#include "core/calibration/landmark_position.h"
#include "core/factor/reprojection.h"
#include "core/model/median.h"

namespace selfcal {
namespace {

// Least redundancy with which the correlation is measured.
constexpr int kLeastRedundancy = 100;

using PoseSteps = Eigen::Matrix<double, 6, Eigen::Dynamic>;

// Steps of theta of one sigma each in independent directions, and the
// corresponding steps of every keyframe's pose.
struct Directions {
  Eigen::MatrixXd theta;
  std::vector<PoseSteps> poses;
};

Directions FindDirections(const SolverRound& round,
                          const LinearisedRound& linearised) {
  const Eigen::MatrixXd reduced =
      round.basis.transpose() * linearised.by_offset.Lambda * round.basis;
  const Eigen::LLT<Eigen::MatrixXd> llt(reduced);
  Directions directions;
  directions.theta = linearised.theta_by_offset * round.basis *
                     llt.matrixU().solve(Eigen::MatrixXd::Identity(
                         reduced.rows(), reduced.cols()));
  const Eigen::Index count = directions.theta.cols();
  std::vector<ChainStateVector> at_rest, moved;
  std::vector<Eigen::Vector3d> landmarks;
  linearised.system.FindSteps(
      Eigen::VectorXd::Zero(directions.theta.rows()), &at_rest, &landmarks);
  directions.poses.assign(at_rest.size(), PoseSteps(6, count));
  for (Eigen::Index j = 0; j < count; ++j) {
    linearised.system.FindSteps(directions.theta.col(j), &moved, &landmarks);
    for (std::size_t k = 0; k < moved.size(); ++k) {
      directions.poses[k].col(j) = (moved[k] - at_rest[k]).head<6>();
    }
  }
  return directions;
}

// Sums over the observations of one landmark, or of all.
struct TrackSums {
  double scatter = 0;      // |g|^2 over the directions
  double information = 0;  // trace, the landmark eliminated
  // Sums of the weight and of the curvature of the loss, each times the
  // sensitivity of the observation to the directions.
  double weight = 0, curvature = 0;
  int observations = 0;
};

// Derivative of the homogeneous point with respect to (alpha, beta, rho).
Eigen::Matrix<double, 4, 3> PointByPosition(const LandmarkPosition& position) {
  Eigen::Matrix<double, 4, 3> by_position = Eigen::Matrix<double, 4, 3>::Zero();
  by_position.topLeftCorner<3, 2>() = position.anchor.R_GA.leftCols<2>();
  by_position.col(2) << position.anchor.a_G, 1;
  return by_position;
}

class TrackSummer {
 public:
  TrackSummer(const SolverRound& round,
              const CalibrationEstimate& estimate,
              const Directions& directions)
      : round_(round),
        thetas_(BoxPlus(round.reference, estimate.d), round.problem),
        keyframes_(estimate.keyframes),
        directions_(directions) {
    for (int t = 0; t < thetas_.size(); ++t) {
      const Eigen::MatrixXd* derivative = thetas_.Derivative(t);
      chain_directions_.push_back(derivative != nullptr
                                      ? *derivative * directions.theta
                                      : directions.theta);
    }
  }

  TrackSums Sum(const ScreenedLandmark& landmark) const {
    const Eigen::Index D = directions_.theta.cols();
    const Track& track = round_.problem.tracks[landmark.track];
    const Eigen::Vector4d point_G = landmark.position.Homogeneous();
    const Eigen::Matrix<double, 4, 3> by_position =
        PointByPosition(landmark.position);
    TrackSums sums;
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(D);
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    H(2, 2) = 1 / (kInverseDepthSigma * kInverseDepthSigma);
    Eigen::Matrix<double, 3, Eigen::Dynamic> coupling =
        Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, D);
    for (const UsedObservation& used : landmark.used) {
      const std::optional<Row> row =
          RowOf(track.observations[used.index], point_G);
      if (!row) continue;
      const double s = row->r.squaredNorm();
      const double weight = used.weight * round_.loss.Weight(s);
      const Eigen::Matrix<double, 2, 3> by_landmark =
          row->by_point * by_position;
      const double square = row->along.squaredNorm();
      gradient += weight * row->along.transpose() * row->r;
      H += weight * by_landmark.transpose() * by_landmark;
      coupling += weight * by_landmark.transpose() * row->along;
      sums.weight += weight * square;
      sums.curvature += used.weight * round_.loss.Curvature(s) * square;
      ++sums.observations;
    }
    const double w = landmark.weight;
    const double absorbed =
        coupling.cwiseProduct(H.ldlt().solve(coupling)).sum();
    sums.scatter = w * w * gradient.squaredNorm();
    sums.information = w * (sums.weight - absorbed);
    sums.weight *= w;
    sums.curvature *= w;
    return sums;
  }

 private:
  // A residual in sigmas, with its derivatives with respect to the homogeneous
  // point and along the directions.
  struct Row {
    Eigen::Vector2d r;
    Eigen::Matrix<double, 2, 4> by_point;
    Eigen::Matrix<double, 2, Eigen::Dynamic> along;
  };

  std::optional<Row> RowOf(const TrackObservation& seen,
                           const Eigen::Vector4d& point_G) const {
    const KeyframeState& x = keyframes_[seen.keyframe];
    const Calibration& theta = thetas_.OfKeyframe(seen.keyframe);
    ReprojectionJacobians jacobians;
    Row row;
    if (!Reproject(x.q_GI,
                   x.p_GI,
                   theta.cameras[seen.camera],
                   point_G,
                   seen.z_px,
                   &row.r,
                   &jacobians,
                   round_.motions.At(seen.keyframe, seen.camera))) {
      return std::nullopt;
    }
    const double scale = 1 / round_.rig.pixel_sigma_px;
    row.r *= scale;
    row.by_point = scale * jacobians.landmark;
    row.along =
        scale *
        (jacobians.camera *
             chain_directions_[thetas_.IndexOf(seen.keyframe)].middleRows(
                 CameraTangentOffset(theta, seen.camera),
                 jacobians.camera.cols()) +
         jacobians.pose * directions_.poses[seen.keyframe]);
    return row;
  }

  const SolverRound& round_;
  const ChainThetas thetas_;
  const std::vector<KeyframeState>& keyframes_;
  const Directions& directions_;
  std::vector<Eigen::MatrixXd> chain_directions_;  // of the theta, by thetas_
};

// The residuals of a landmark in the last keyframe of a camera and in the one
// before.
struct LastResiduals {
  int keyframe = -1;
  int count = 0;  // of successive keyframes
  Eigen::Vector2d one_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d two_px = Eigen::Vector2d::Zero();
};

}  // namespace

double TrackNoiseFactor(const SolverRound& round,
                        const LinearisedRound& linearised,
                        const CalibrationEstimate& estimate,
                        const std::vector<ScreenedLandmark>& landmarks) {
  if (round.basis.cols() == 0) return 0;
  const Directions directions = FindDirections(round, linearised);
  const TrackSummer summer(round, estimate, directions);
  TrackSums all;
  for (const ScreenedLandmark& landmark : landmarks) {
    const TrackSums sums = summer.Sum(landmark);
    all.scatter += sums.scatter;
    all.information += sums.information;
    all.weight += sums.weight;
    all.curvature += sums.curvature;
    all.observations += sums.observations;
  }
  // Keyframes and theta adapt to the errors and reduce the residuals.
  const double residuals = 2.0 * all.observations - 3.0 * landmarks.size();
  const double absorbed = 6.0 * estimate.keyframes.size() + round.basis.cols();
  if (!(residuals - absorbed > kLeastRedundancy) || !(all.information > 0) ||
      !(all.curvature > 0)) {
    return 0;
  }
  const double stiffness = all.curvature / all.weight;
  return std::sqrt(all.scatter / all.information * residuals /
                   (residuals - absorbed)) /
         stiffness;
}

double SuccessiveNoiseRatio(const SolverRound& round,
                            const CalibrationEstimate& estimate,
                            const std::vector<ScreenedLandmark>& landmarks) {
  const ChainThetas thetas(BoxPlus(round.reference, estimate.d), round.problem);
  std::vector<double> squares, differences;
  for (const ScreenedLandmark& landmark : landmarks) {
    const Track& track = round.problem.tracks[landmark.track];
    const Eigen::Vector4d point_G = landmark.position.Homogeneous();
    std::map<int, LastResiduals> of_cameras;
    for (const UsedObservation& used : landmark.used) {
      const TrackObservation& seen = track.observations[used.index];
      const KeyframeState& x = estimate.keyframes[seen.keyframe];
      Eigen::Vector2d r_px;
      if (!Reproject(x.q_GI,
                     x.p_GI,
                     thetas.OfKeyframe(seen.keyframe).cameras[seen.camera],
                     point_G,
                     seen.z_px,
                     &r_px,
                     nullptr,
                     round.motions.At(seen.keyframe, seen.camera))) {
        continue;
      }
      LastResiduals& last = of_cameras[seen.camera];
      if (seen.keyframe != last.keyframe + 1) last.count = 0;
      if (last.count >= 2) {
        squares.push_back(last.one_px.squaredNorm());
        differences.push_back(
            (r_px - 2 * last.one_px + last.two_px).squaredNorm() / 6);
      }
      last = {seen.keyframe, last.count + 1, r_px, last.one_px};
    }
  }
  if (static_cast<int>(squares.size()) < kLeastRedundancy) return 1;
  const double square = UpperMedian(std::move(squares));
  if (!(square > 0)) return 1;
  return std::min(1.0, std::sqrt(UpperMedian(std::move(differences)) / square));
}

}  // namespace selfcal
