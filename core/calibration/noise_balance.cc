#include "core/calibration/noise_balance.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/model/second_imu.h"

namespace selfcal {
namespace {

// The kinds of the first IMU.
constexpr NoiseKind kInertialKinds[kNoiseKindsOfImu] = {
    NoiseKind::kGyro,
    NoiseKind::kAccel,
    NoiseKind::kGyroBiasWalk,
    NoiseKind::kAccelBiasWalk};

constexpr std::size_t kMinPieceObservations = 2;

// Makes each piece of a track a separate landmark: the connection of distant
// keyframes has almost no information about noise, and adds unknowns to every
// front of the elimination.
std::vector<ScreenedLandmark> SplitIntoPieces(
    const CalibrationProblem& problem,
    const std::vector<ScreenedLandmark>& landmarks) {
  std::vector<ScreenedLandmark> parts;
  for (const ScreenedLandmark& whole : landmarks) {
    const Track& track = problem.tracks[whole.track];
    ScreenedLandmark part = whole;
    const auto finish = [&] {
      if (part.used.size() >= kMinPieceObservations) parts.push_back(part);
      part.used.clear();
    };
    part.used.clear();
    for (const UsedObservation& used : whole.used) {
      if (!part.used.empty() && PieceOf(track, used.index) !=
                                    PieceOf(track, part.used.back().index)) {
        finish();
      }
      part.used.push_back(used);
    }
    finish();
  }
  return parts;
}

// Ratio of the expected weighted squares to the expected squares of a residual
// with two normal components of the given variance [sigma^2].
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

template <int kinds>
std::vector<typename NoiseProblem<kinds>::LinkNoise>
NoiseProblem<kinds>::SplitInertialNoise(
    const SolverRound& round,
    const ChainThetas& thetas,
    const std::vector<KeyframeState>& keyframes) {
  std::array<ImuNoise, kinds> alone;
  for (int imu = 0; imu < ImuCount(round.reference); ++imu) {
    for (const NoiseKind kind : kInertialKinds) {
      Rig rig = round.rig;
      for (const NoiseKind other : kInertialKinds) {
        if (other != kind) ScaleNoise(OfImu(other, imu), 0, &rig);
      }
      alone[IndexOf(OfImu(kind, imu))] = NoiseOfImu(rig, imu);
    }
  }
  std::vector<LinkNoise> split;
  for (const InertialLink& link : round.problem.inertial_links) {
    const auto covariance = [&](const ImuNoise& noise) {
      const Calibration& theta = thetas.OfKeyframe(link.before);
      InertialMatrix covariance;
      EvaluateInertial(link.samples,
                       StateOfImu(theta, link.imu, keyframes[link.before]),
                       StateOfImu(theta, link.imu, keyframes[link.after]),
                       ImuOf(theta, link.imu),
                       noise,
                       round.rig.gravity_mps2,
                       nullptr,
                       &covariance);
      return covariance;
    };
    LinkNoise& noise = split.emplace_back();
    noise.imu = link.imu;
    noise.gaps = covariance({0, 0, 0, 0});
    for (int i = 0; i < kNoiseKindsOfImu; ++i) {
      const NoiseKind kind = OfImu(kInertialKinds[i], link.imu);
      noise.of_kinds[i] = covariance(alone[IndexOf(kind)]) - noise.gaps;
    }
  }
  return split;
}

template <int kinds>
NoiseProblem<kinds>::NoiseProblem(
    const SolverRound& round,
    const CalibrationEstimate& estimate,
    const std::vector<ScreenedLandmark>& landmarks,
    double track_noise,
    double least_excess)
    : round_(round),
      estimate_(estimate),
      track_noise_(track_noise),
      least_excess_(least_excess),
      inertial_(SplitInertialNoise(
          round,
          ChainThetas(BoxPlus(round.reference, estimate.d), round.problem),
          estimate.keyframes)),
      landmarks_(SplitIntoPieces(round.problem, landmarks)),
      rig_(round.rig),
      problem_(round.problem),
      whitening_(round.whitening) {}

template <int kinds>
std::optional<NoiseBalance<kinds>> NoiseProblem<kinds>::Evaluate(
    const Vector& log_factors) {
  const Vector factors = log_factors.array().exp();
  rig_ = round_.rig;
  for (int i = 0; i < kinds; ++i) {
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

// The common errors of a track do not depend on the pixel sigma.
template <int kinds>
void NoiseProblem<kinds>::ScaleLandmarks(double pixel_factor) {
  const double excess = std::max(least_excess_, track_noise_ / pixel_factor);
  for (ScreenedLandmark& landmark : landmarks_) {
    landmark.weight *= excess_ * excess_ / (excess * excess);
  }
  excess_ = excess;
}

template <int kinds>
void NoiseProblem<kinds>::ScaleInertial(const Vector& factors) {
  for (std::size_t i = 0; i < inertial_.size(); ++i) {
    InertialMatrix covariance = inertial_[i].gaps;
    for (int k = 0; k < kNoiseKindsOfImu; ++k) {
      const NoiseKind kind = OfImu(kInertialKinds[k], inertial_[i].imu);
      const double factor = factors[IndexOf(kind)];
      covariance += factor * factor * inertial_[i].of_kinds[k];
    }
    whitening_[i] = SquareRootInformation(covariance);
  }
  Eigen::Matrix<double, 6, 1> walks;
  walks.head<3>().setConstant(factors[IndexOf(NoiseKind::kAccelBiasWalk)]);
  walks.tail<3>().setConstant(factors[IndexOf(NoiseKind::kGyroBiasWalk)]);
  for (std::size_t i = 0; i < problem_.bias_links.size(); ++i) {
    problem_.bias_links[i].sigmas =
        round_.problem.bias_links[i].sigmas.cwiseProduct(walks);
  }
}

template <int kinds>
NoiseBalance<kinds> NoiseProblem<kinds>::Count(const Vector& factors,
                                               const RobustLoss& loss) const {
  // The minimising step of theta, and its covariance.
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
  Balance balance;
  AddMotion(factors, posterior, &balance);

  AddPixels(posterior,
            posterior.unknowns + static_cast<double>(basis.cols()) -
                AbsorbedByPrior(inverse),
            loss,
            &balance);
  return balance;
}

// Part of the unknowns that the prior on theta absorbs, if there is one.
template <int kinds>
double NoiseProblem<kinds>::AbsorbedByPrior(
    const Eigen::MatrixXd& inverse) const {
  if (round_.prior_information == nullptr) return 0;
  return inverse
      .cwiseProduct(round_.basis.transpose() * *round_.prior_information *
                    round_.basis)
      .sum();
}

template <int kinds>
void NoiseProblem<kinds>::AddMotion(const Vector& factors,
                                    const LinearPosterior& posterior,
                                    Balance* balance) const {
  const auto add = [&](NoiseKind kind, double squares, double redundancy) {
    balance->squares[IndexOf(kind)] += squares;
    balance->redundancy[IndexOf(kind)] += redundancy;
  };
  for (std::size_t i = 0; i < inertial_.size(); ++i) {
    // Squares |e|^2 and their redundancy are sums over the kinds and gaps,
    // whose parts of the covariance add up to W^-1 W^-T.
    const InertialMatrix& W = whitening_[i];
    const InertialResidual by_noise = W.transpose() * posterior.inertial[i];
    const InertialMatrix left =
        W.transpose() *
        (InertialMatrix::Identity() - posterior.inertial_covariance[i]) * W;
    for (int k = 0; k < kNoiseKindsOfImu; ++k) {
      const NoiseKind kind = OfImu(kInertialKinds[k], inertial_[i].imu);
      const double factor = factors[IndexOf(kind)];
      const InertialMatrix noise = factor * factor * inertial_[i].of_kinds[k];
      add(kind, by_noise.dot(noise * by_noise), noise.cwiseProduct(left).sum());
    }
  }
  add(NoiseKind::kAccelBiasWalk,
      posterior.walk_squares.head<3>().sum(),
      posterior.walk_redundancy.head<3>().sum());
  add(NoiseKind::kGyroBiasWalk,
      posterior.walk_squares.tail<3>().sum(),
      posterior.walk_redundancy.tail<3>().sum());
}

// Reprojections absorb the remaining unknowns, which no other kind absorbs.
template <int kinds>
void NoiseProblem<kinds>::AddPixels(const LinearPosterior& posterior,
                                    double unknowns,
                                    const RobustLoss& loss,
                                    Balance* balance) const {
  if (posterior.observations == 0) return;
  double absorbed = unknowns - posterior.prior_absorbed - posterior.walk_rows;
  for (const InertialMatrix& C : posterior.inertial_covariance) {
    absorbed -= C.trace();
  }
  absorbed += posterior.walk_redundancy.sum();
  // Observations, and what is absorbed of them, count by their weight.
  absorbed =
      posterior.weight_of_absorbed * (absorbed - 3 * posterior.landmarks) +
      3 * posterior.landmark_weights;
  const double rows = 2 * posterior.weighted_observations;
  const double redundancy = rows - absorbed;
  balance->redundancy[IndexOf(NoiseKind::kPixel)] = redundancy;
  balance->squares[IndexOf(NoiseKind::kPixel)] =
      posterior.pixel_squares / Consistency(loss, redundancy / rows);
}

template class NoiseProblem<kNoiseKinds>;
template class NoiseProblem<kMaxNoiseKinds>;

}  // namespace selfcal
