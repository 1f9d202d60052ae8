#include "core/calibration/noise_balance.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace selfcal {
namespace {

using MotionMatrix = Eigen::Matrix<double, 9, 9>;

constexpr std::size_t kMinObservations = 2;

// Each piece of a track becomes a landmark of its own: that it ties distant
// keyframes says next to nothing about noise, and costs unknowns in every front
// of the elimination.
std::vector<ScreenedLandmark> SplitIntoPieces(
    const CalibrationProblem& problem,
    const std::vector<ScreenedLandmark>& landmarks) {
  std::vector<ScreenedLandmark> parts;
  for (const ScreenedLandmark& whole : landmarks) {
    const Track& track = problem.tracks[whole.track];
    ScreenedLandmark part = whole;
    const auto finish = [&] {
      if (part.used.size() >= kMinObservations) parts.push_back(part);
      part.used.clear();
    };
    part.used.clear();
    for (const UsedObservation& used : whole.used) {
      if (!part.used.empty() &&
          PieceOf(track, used.index) !=
              PieceOf(track, part.used.back().index)) {
        finish();
      }
      part.used.push_back(used);
    }
    finish();
  }
  return parts;
}

// What the weighted squares of a residual of two normal components of the
// given variance [sigma^2] are on average, in parts of its squares.
double Consistency(const RobustLoss& loss, double variance) {
  constexpr int kSteps = 400;
  constexpr double kEnd = 40;  // of s / 2, exponentially distributed
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double half = kEnd * (i + 0.5) / kSteps;
    sum += loss.Weight(2 * half * variance) * half * std::exp(-half);
  }
  return sum * kEnd / kSteps;
}

}  // namespace

std::vector<NoiseProblem::MotionNoise> NoiseProblem::SplitMotionNoise(
    const SolverRound& round,
    const ImuCalibration& imu,
    const std::vector<KeyframeState>& keyframes) {
  const auto covariance = [&](const InertialLink& link, ImuNoise noise) {
    InertialMatrix covariance;
    EvaluateInertial(link.samples,
                     keyframes[link.before],
                     keyframes[link.after],
                     imu,
                     noise,
                     round.rig.gravity_mps2,
                     nullptr,
                     &covariance);
    return covariance.topLeftCorner<9, 9>().eval();
  };
  ImuNoise gyro = round.rig.imu_noise;
  ImuNoise accel = gyro;
  gyro.accel_noise_density = 0;
  accel.gyro_noise_density = 0;
  std::vector<MotionNoise> split;
  for (const InertialLink& link : round.problem.inertial_links) {
    split.push_back({covariance(link, gyro), covariance(link, accel)});
  }
  return split;
}

NoiseProblem::NoiseProblem(const SolverRound& round,
                           const CalibrationEstimate& estimate,
                           const std::vector<ScreenedLandmark>& landmarks,
                           double track_noise)
    : round_(round),
      estimate_(estimate),
      track_noise_(track_noise),
      motion_(SplitMotionNoise(
          round, BoxPlus(round.reference, estimate.d).imu, estimate.keyframes)),
      landmarks_(SplitIntoPieces(round.problem, landmarks)),
      rig_(round.rig),
      problem_(round.problem),
      whitening_(round.whitening) {}

std::optional<NoiseBalance> NoiseProblem::Evaluate(
    const NoiseVector& log_factors) {
  const NoiseVector factors = log_factors.array().exp();
  rig_ = round_.rig;
  for (int i = 0; i < kNoiseKinds; ++i) {
    ScaleNoise(static_cast<NoiseKind>(i), factors[i], &rig_);
  }
  ScaleLandmarks(factors[IndexOf(NoiseKind::kPixel)]);
  ScaleInertial(factors);
  RobustLoss loss = round_.loss;
  loss.gate = std::max(kOutlierGate, 2 * loss.scale);
  const SolverRound round = {.rig = rig_,
                             .reference = round_.reference,
                             .problem = problem_,
                             .motions = round_.motions,
                             .whitening = whitening_,
                             .basis = round_.basis,
                             .loss = loss,
                             .prior_information = round_.prior_information};
  if (!LineariseFactors(round, estimate_, landmarks_, &loss, &linearised_)) {
    return std::nullopt;
  }
  return Count(factors, loss);
}

// What the errors of a track have in common is there whatever the pixel sigma.
void NoiseProblem::ScaleLandmarks(double pixel_factor) {
  const double excess = std::max(1.0, track_noise_ / pixel_factor);
  for (ScreenedLandmark& landmark : landmarks_) {
    landmark.weight *= excess_ * excess_ / (excess * excess);
  }
  excess_ = excess;
}

void NoiseProblem::ScaleInertial(const NoiseVector& factors) {
  const double gyro = factors[IndexOf(NoiseKind::kGyro)];
  const double accel = factors[IndexOf(NoiseKind::kAccel)];
  InertialResidual walks = InertialResidual::Zero();
  walks.segment<3>(9).setConstant(factors[IndexOf(NoiseKind::kAccelBiasWalk)]);
  walks.segment<3>(12).setConstant(factors[IndexOf(NoiseKind::kGyroBiasWalk)]);
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    InertialMatrix covariance = InertialMatrix::Identity();
    covariance.topLeftCorner<9, 9>() =
        gyro * gyro * motion_[i].gyro + accel * accel * motion_[i].accel;
    InertialMatrix W = SquareRootInformation(covariance);
    for (int m = 9; m < 15; ++m) {
      W(m, m) = round_.whitening[i](m, m) / walks[m];
    }
    whitening_[i] = W;
  }
  for (std::size_t i = 0; i < problem_.bias_links.size(); ++i) {
    problem_.bias_links[i].sigmas =
        round_.problem.bias_links[i].sigmas.cwiseProduct(walks.tail<6>());
  }
}

NoiseBalance NoiseProblem::Count(const NoiseVector& factors,
                                 const RobustLoss& loss) const {
  // The step of theta that minimises, and its covariance.
  const Eigen::MatrixXd& basis = round_.basis;
  Eigen::VectorXd step = Eigen::VectorXd::Zero(basis.rows());
  Eigen::MatrixXd inverse(0, 0);
  if (basis.cols() > 0) {
    const SharedInformation& by_offset = linearised_.by_offset;
    const Eigen::LLT<Eigen::MatrixXd> reduced(basis.transpose() *
                                              by_offset.Lambda * basis);
    step = basis * reduced.solve(basis.transpose() * by_offset.eta);
    inverse =
        reduced.solve(Eigen::MatrixXd::Identity(basis.cols(), basis.cols()));
  }
  const Eigen::MatrixXd moves = linearised_.theta_by_offset * basis;
  const LinearPosterior posterior =
      linearised_.system.FindPosterior(linearised_.theta_by_offset * step,
                                       moves * inverse * moves.transpose(),
                                       landmarks_);
  NoiseBalance balance;
  AddMotion(factors, posterior, &balance);

  AddPixels(posterior,
            posterior.unknowns + static_cast<double>(basis.cols()) -
                AbsorbedByPrior(inverse),
            loss,
            &balance);
  return balance;
}

// Of the prior on theta, if there is one.
double NoiseProblem::AbsorbedByPrior(const Eigen::MatrixXd& inverse) const {
  if (round_.prior_information == nullptr) return 0;
  return inverse
      .cwiseProduct(round_.basis.transpose() * *round_.prior_information *
                    round_.basis)
      .sum();
}

void NoiseProblem::AddMotion(const NoiseVector& factors,
                             const LinearPosterior& posterior,
                             NoiseBalance* balance) const {
  const auto add = [&](NoiseKind kind, double squares, double redundancy) {
    balance->squares[IndexOf(kind)] += squares;
    balance->redundancy[IndexOf(kind)] += redundancy;
  };
  const double gyro = factors[IndexOf(NoiseKind::kGyro)];
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    const ChainStateVector& e = posterior.inertial[i];
    const ChainStateMatrix& C = posterior.inertial_covariance[i];
    const auto W = whitening_[i].topLeftCorner<9, 9>();
    // What of the whitened noise the gyroscope brings; the accelerometer
    // brings the rest.
    const MotionMatrix by_gyro =
        gyro * gyro * W * motion_[i].gyro * W.transpose();
    const MotionMatrix left =
        MotionMatrix::Identity() - C.topLeftCorner<9, 9>();
    const double squares = e.head<9>().dot(by_gyro * e.head<9>());
    const double redundancy = by_gyro.cwiseProduct(left).sum();
    add(NoiseKind::kGyro, squares, redundancy);
    add(NoiseKind::kAccel,
        e.head<9>().squaredNorm() - squares,
        left.trace() - redundancy);
    add(NoiseKind::kAccelBiasWalk,
        e.segment<3>(9).squaredNorm(),
        3 - C.diagonal().segment<3>(9).sum());
    add(NoiseKind::kGyroBiasWalk,
        e.segment<3>(12).squaredNorm(),
        3 - C.diagonal().segment<3>(12).sum());
  }
  add(NoiseKind::kAccelBiasWalk,
      posterior.walk_squares.head<3>().sum(),
      posterior.walk_redundancy.head<3>().sum());
  add(NoiseKind::kGyroBiasWalk,
      posterior.walk_squares.tail<3>().sum(),
      posterior.walk_redundancy.tail<3>().sum());
}

// What no other kind absorbs of the unknowns, reprojections do.
void NoiseProblem::AddPixels(const LinearPosterior& posterior,
                             double unknowns,
                             const RobustLoss& loss,
                             NoiseBalance* balance) const {
  if (posterior.observations == 0) return;
  double absorbed = unknowns - posterior.prior_absorbed - posterior.walk_rows;
  for (const ChainStateMatrix& C : posterior.inertial_covariance) {
    absorbed -= C.trace();
  }
  absorbed += posterior.walk_redundancy.sum();
  // Observations of less weight count less, and what is absorbed of them.
  absorbed =
      posterior.weight_of_absorbed * (absorbed - 3 * posterior.landmarks) +
      3 * posterior.landmark_weights;
  const double rows = 2 * posterior.weighted_observations;
  const double redundancy = rows - absorbed;
  balance->redundancy[IndexOf(NoiseKind::kPixel)] = redundancy;
  balance->squares[IndexOf(NoiseKind::kPixel)] =
      posterior.pixel_squares / Consistency(loss, redundancy / rows);
}

}  // namespace selfcal
