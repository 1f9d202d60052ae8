#include "core/calibration/noise_scales.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/calibration/noise_balance.h"
#include "core/calibration/track_noise.h"
#include "core/model/median.h"
#include "core/model/second_imu.h"
#include "core/model/square.h"

namespace selfcal {
namespace {

template <int kinds>
using NoiseMatrix = Eigen::Matrix<double, kinds, kinds>;

// Prior sigma of the logarithm of a noise scale.
const double kPriorLogSigma = std::log(10.0);
// Errors in the stated noise of an IMU are correlated: given one of its noise
// scales, the logarithms of the others have this sigma about it.
const double kConditionalLogSigma = std::log(2.0);
constexpr double kDifference =
    0.1;  // step of the logarithms for difference quotients
// A step does not increase the logarithm of a noise scale by more than
// kLongestStep, nor reduce a variance below kLeastPart of it.
constexpr double kLongestStep = 1.5;  // of the logarithm of the factor
constexpr double kLeastPart = 0.1;
constexpr int kMaxSteps = 25;
constexpr int kMaxHalvings = 3;
// Converged when the next step is shorter, in standard deviations.
constexpr double kSettledSigmas = 0.1;
constexpr double kSettledSigmasOfGuess = 0.3;
// Bound: for a redundancy r, the Fisher information is at most 2 r.
constexpr double kMayBeDetermined = 0.5 / Square(kDeterminedLogSigma);
// The Fisher information is computed again if the logarithm of a noise scale is
// further than kMaxDistance from where it was computed, and the redundancy of
// that kind is above kRelevantRedundancy, so that its information may exceed
// that of the prior: noise that is stated far too small has almost no
// redundancy at the stated value, and much at the actual one.
constexpr double kMaxDistance = 0.3;
constexpr double kRelevantRedundancy = 0.5;
// Errors of tracks have much in common if the track noise exceeds the noise
// scale of pixels by this factor, or that scale the noise between successive
// keyframes.
constexpr double kMuchInCommon = 1.2;
// Part of the rows of the gyroscope that is not absorbed where images decide.
constexpr double kImagesDecide = 0.5;

// Prior information about the logarithms of the noise scales relative to the
// stated noise.
template <int kinds>
NoiseMatrix<kinds> PriorInformation() {
  NoiseMatrix<kinds> covariance = NoiseMatrix<kinds>::Constant(
      Square(kPriorLogSigma) - Square(kConditionalLogSigma));
  constexpr int kPixel = IndexOf(NoiseKind::kPixel);
  covariance.row(kPixel).setZero();
  covariance.col(kPixel).setZero();
  covariance.diagonal().setConstant(Square(kPriorLogSigma));
  return covariance.inverse();
}

// Score and Fisher information of the logarithms of the noise scales, including
// the prior. The Fisher information of a restricted likelihood follows from the
// derivatives of the redundancies with respect to the scales.
template <int kinds>
class Likelihood {
  using Vector = NoiseVector<kinds>;
  using Matrix = NoiseMatrix<kinds>;

 public:
  // `taken`: logarithms of the noise of the problem relative to the stated
  // noise.
  Likelihood(NoiseProblem<kinds>* problem, const Vector& taken)
      : problem_(problem), taken_(taken) {}

  bool MoveTo(const Vector& at) {
    const std::optional<NoiseBalance<kinds>> balance = problem_->Evaluate(at);
    if (!balance) return false;
    at_ = at;
    balance_ = *balance;
    return true;
  }

  const Vector& at() const { return at_; }
  const NoiseBalance<kinds>& balance() const { return balance_; }

  Vector Score() const {
    return balance_.squares - balance_.redundancy - prior_ * (taken_ + at_);
  }

  std::optional<Matrix> Fisher() const {
    constexpr int kPixel = IndexOf(NoiseKind::kPixel);
    const bool pixels_count = problem_->PixelsCount();
    Matrix by_factor = Matrix::Zero();
    if (!FindDifferences(&by_factor)) return std::nullopt;
    // Redundancies do not change if all noise scales change by the same factor.
    if (pixels_count) {
      for (int i = 1; i < kinds; ++i) {
        SetBoth(kPixel, i, -by_factor.row(i).sum(), &by_factor);
      }
      by_factor(kPixel, kPixel) = -by_factor.row(kPixel).sum();
    }
    Matrix fisher = -by_factor;
    fisher.diagonal() += 2 * balance_.redundancy;
    // Differences may turn a zero eigenvalue into a negative one.
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(fisher);
    return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() *
               eigen.eigenvectors().transpose() +
           prior_;
  }

 private:
  static void SetBoth(int i, int j, double value, Matrix* matrix) {
    (*matrix)(i, j) = (*matrix)(j, i) = value;
  }

  // Derivatives of the redundancies of inertial residuals with respect to the
  // logarithms of their noise scales; those that concern pixels are not set.
  // False if the linear system fails.
  bool FindDifferences(Matrix* by_factor) const {
    if constexpr (kinds == kNoiseKinds) {
      return FindDifferencesOfOneImu(by_factor);
    } else {
      for (int i = 1; i < kinds; ++i) {
        const auto change = Difference(Vector::Unit(i));
        if (!change) return false;
        by_factor->col(i).tail(kinds - 1) = change->tail(kinds - 1);
      }
      *by_factor = (0.5 * (*by_factor + by_factor->transpose())).eval();
      return true;
    }
  }

  // Computed from two differences: a walk interacts with the noise of its own
  // sensor only, so that the noise of each sensor is varied together with the
  // walk of the other.
  bool FindDifferencesOfOneImu(Matrix* by_factor) const {
    constexpr int kGyro = IndexOf(NoiseKind::kGyro);
    constexpr int kAccel = IndexOf(NoiseKind::kAccel);
    constexpr int kGyroWalk = IndexOf(NoiseKind::kGyroBiasWalk);
    constexpr int kAccelWalk = IndexOf(NoiseKind::kAccelBiasWalk);
    const auto a = Difference(Vector::Unit(kGyro) + Vector::Unit(kAccelWalk));
    const auto b = Difference(Vector::Unit(kAccel) + Vector::Unit(kGyroWalk));
    if (!a || !b) return false;
    (*by_factor)(kGyro, kGyro) = (*a)[kGyro];
    (*by_factor)(kAccel, kAccel) = (*b)[kAccel];
    (*by_factor)(kGyroWalk, kGyroWalk) = (*b)[kGyroWalk];
    (*by_factor)(kAccelWalk, kAccelWalk) = (*a)[kAccelWalk];
    const double gyro_and_walk = (*a)[kGyroWalk];
    const double accel_and_walk = (*b)[kAccelWalk];
    SetBoth(kGyro, kGyroWalk, gyro_and_walk, by_factor);
    SetBoth(kAccel, kAccelWalk, accel_and_walk, by_factor);
    SetBoth(kGyro,
            kAccel,
            0.5 * ((*a)[kAccel] - accel_and_walk + (*b)[kGyro] - gyro_and_walk),
            by_factor);
    return true;
  }

  // Difference quotient of the redundancies for a change of the logarithms of
  // noise scales.
  std::optional<Vector> Difference(const Vector& direction) const {
    const std::optional<NoiseBalance<kinds>> moved =
        problem_->Evaluate(at_ + kDifference * direction);
    if (!moved) return std::nullopt;
    return (moved->redundancy - balance_.redundancy) / kDifference;
  }

  NoiseProblem<kinds>* problem_;
  const Vector taken_;
  const Matrix prior_ = PriorInformation<kinds>();
  Vector at_ = Vector::Zero();
  NoiseBalance<kinds> balance_;
};

// The Fisher information and the point at which it was computed.
template <int kinds>
struct FisherEvaluation {
  NoiseMatrix<kinds> fisher;
  NoiseVector<kinds> at, redundancy;
};

template <int kinds>
std::optional<FisherEvaluation<kinds>> EvaluateFisher(
    const Likelihood<kinds>& likelihood) {
  const std::optional<NoiseMatrix<kinds>> fisher = likelihood.Fisher();
  if (!fisher) return std::nullopt;
  return FisherEvaluation<kinds>{
      *fisher, likelihood.at(), likelihood.balance().redundancy};
}

template <int kinds>
bool StillHolds(const FisherEvaluation<kinds>& evaluation,
                const Likelihood<kinds>& likelihood) {
  for (int i = 0; i < kinds; ++i) {
    if (std::max(evaluation.redundancy[i], likelihood.balance().redundancy[i]) >
            kRelevantRedundancy &&
        std::abs(likelihood.at()[i] - evaluation.at[i]) > kMaxDistance) {
      return false;
    }
  }
  return true;
}

// The tolerance is tight for kinds that may be determined; the others remain
// guesses in any case.
template <int kinds>
bool IsSettled(const NoiseVector<kinds>& change,
               const FisherEvaluation<kinds>& evaluation) {
  const NoiseMatrix<kinds> covariance = evaluation.fisher.inverse();
  for (int i = 0; i < kinds; ++i) {
    const double allowed = evaluation.redundancy[i] > kMayBeDetermined
                               ? kSettledSigmas
                               : kSettledSigmasOfGuess;
    if (std::abs(change[i]) > allowed * std::sqrt(covariance(i, i))) {
      return false;
    }
  }
  return true;
}

template <int kinds>
struct Maximum {
  NoiseMatrix<kinds> fisher;
  bool converged = false;
};

// Fisher scoring of the variances, in which the expected squares are linear:
// the first step comes near the maximum from anywhere. The information is then
// corrected by the observed change of the score in each step (Broyden). A step
// that does not bring the score nearer to zero, in its own standard deviations,
// is halved. Returns nullopt if the linear system fails.
template <int kinds>
std::optional<Maximum<kinds>> Maximise(Likelihood<kinds>* likelihood) {
  using Vector = NoiseVector<kinds>;
  std::optional<FisherEvaluation<kinds>> evaluation =
      EvaluateFisher(*likelihood);
  if (!evaluation) return std::nullopt;
  NoiseMatrix<kinds> slope = evaluation->fisher;
  const auto size_of = [&](const Vector& score) {
    return std::sqrt(score.dot(evaluation->fisher.ldlt().solve(score)));
  };
  for (int i = 0; i < kMaxSteps; ++i) {
    const Vector score = likelihood->Score();
    Vector change = slope.partialPivLu().solve(score);
    if (!change.allFinite() || change.dot(score) <= 0) {
      slope = evaluation->fisher;
      change = slope.ldlt().solve(score);
    }
    if (IsSettled(change, *evaluation))
      return Maximum<kinds>{evaluation->fisher, true};
    const Vector from = likelihood->at();
    Vector step = (0.5 * (1 + 2 * change.array()).max(kLeastPart).log())
                      .min(kLongestStep);
    const double before = size_of(score);
    for (int halving = 0;; ++halving) {
      if (!likelihood->MoveTo(from + step)) return std::nullopt;
      if (halving == kMaxHalvings || size_of(likelihood->Score()) < before) {
        break;
      }
      step *= 0.5;
    }
    if (StillHolds(*evaluation, *likelihood)) {
      const Vector shown = score - likelihood->Score();
      slope += (shown - slope * step) * step.transpose() / step.squaredNorm();
    } else {
      evaluation = EvaluateFisher(*likelihood);
      if (!evaluation) return std::nullopt;
      slope = evaluation->fisher;
    }
  }
  return Maximum<kinds>{evaluation->fisher, false};
}

// Estimates the noise scale of pixels from the median residual, as if all
// residuals had the same redundancy.
double GuessPixelFactor(const SolverRound& round,
                        const CalibrationEstimate& estimate,
                        const std::vector<ScreenedLandmark>& landmarks) {
  const ReprojectionStatistics pixels =
      MeasureReprojection(round.rig,
                          BoxPlus(round.reference, estimate.d),
                          round.problem,
                          estimate.keyframes,
                          round.motions,
                          landmarks);
  if (!(pixels.median_px > 0)) return 1;
  double rows = 0;
  for (const ScreenedLandmark& landmark : landmarks) {
    rows += 2.0 * static_cast<double>(landmark.used.size());
  }
  const double absorbed = 3.0 * static_cast<double>(landmarks.size()) +
                          6.0 * static_cast<double>(estimate.keyframes.size());
  const double left = std::max(1 - absorbed / rows, kLeastPart);
  return pixels.median_px / kMedianOfRayleigh / round.rig.pixel_sigma_px /
         std::sqrt(left);
}

// The degree, from 0 to 1, to which images rather than the gyroscope decide how
// one keyframe moves against the next. Where the gyroscope decides, its
// residuals are absorbed, and slower errors of pixels tell the noise scales
// apart.
double ShareOfImages(const SolverRound& round,
                     const std::vector<NoiseScale>& scales) {
  const auto& links = round.problem.inertial_links;
  const double rows =
      3.0 * static_cast<double>(std::count_if(
                links.begin(), links.end(), [](const InertialLink& link) {
                  return link.imu == 0;
                }));
  return std::min(
      1.0,
      scales[IndexOf(NoiseKind::kGyro)].redundancy / (kImagesDecide * rows));
}

// The maximum from this start. Takes the problem, whose linear system is large,
// so that it ends here.
template <int kinds>
std::vector<NoiseScale> ScalesFrom(const NoiseVector<kinds>& start,
                                   const NoiseVector<kinds>& taken,
                                   NoiseProblem<kinds> problem) {
  Likelihood<kinds> likelihood(&problem, taken);
  if (!likelihood.MoveTo(start)) return {};
  const std::optional<Maximum<kinds>> maximum = Maximise(&likelihood);
  if (!maximum) return {};
  const NoiseMatrix<kinds> covariance = maximum->fisher.inverse();
  std::vector<NoiseScale> scales;
  for (int i = 0; i < kinds; ++i) {
    const double redundancy = likelihood.balance().redundancy[i];
    // The information may have been computed at a distant point.
    const double least = 1 / (2 * redundancy + PriorInformation<kinds>()(i, i));
    scales.push_back({static_cast<NoiseKind>(i),
                      std::exp(likelihood.at()[i]),
                      std::sqrt(std::max(covariance(i, i), least)),
                      redundancy,
                      1,
                      maximum->converged});
  }
  return scales;
}

template <int kinds>
std::vector<NoiseScale> EstimateScales(
    const Rig& stated,
    const SolverRound& round,
    const CalibrationEstimate& estimate,
    const std::vector<ScreenedLandmark>& landmarks,
    double track_noise) {
  NoiseVector<kinds> taken;
  for (int i = 0; i < kinds; ++i) {
    const auto kind = static_cast<NoiseKind>(i);
    taken[i] = std::log(NoiseOf(kind, round.rig) / NoiseOf(kind, stated));
  }
  NoiseVector<kinds> start = NoiseVector<kinds>::Zero();
  start[IndexOf(NoiseKind::kPixel)] =
      std::log(GuessPixelFactor(round, estimate, landmarks));
  std::vector<NoiseScale> scales =
      ScalesFrom(start,
                 taken,
                 NoiseProblem<kinds>(round, estimate, landmarks, track_noise));
  if (scales.empty()) return scales;
  const double successive = SuccessiveNoiseRatio(round, estimate, landmarks);
  if (track_noise < kMuchInCommon * scales[IndexOf(NoiseKind::kPixel)].factor &&
      kMuchInCommon * successive > 1) {
    return scales;
  }
  for (int i = 0; i < kinds; ++i) start[i] = std::log(scales[i].factor);
  const std::vector<NoiseScale> others = ScalesFrom(
      start,
      taken,
      NoiseProblem<kinds>(round,
                          estimate,
                          landmarks,
                          0,
                          std::pow(successive, ShareOfImages(round, scales))));
  if (others.empty()) return {};
  for (int imu = 0; imu < ImuCount(stated.factory); ++imu) {
    for (const NoiseKind kind : {NoiseKind::kGyro, NoiseKind::kAccel}) {
      const NoiseScale& other = others[IndexOf(OfImu(kind, imu))];
      NoiseScale& scale = scales[IndexOf(OfImu(kind, imu))];
      if (other.factor > scale.factor) scale = other;
    }
  }
  return scales;
}

}  // namespace

std::vector<NoiseScale> EstimateNoiseScales(
    const Rig& stated,
    const SolverRound& round,
    const CalibrationEstimate& estimate,
    const std::vector<ScreenedLandmark>& landmarks,
    double track_noise) {
  return ImuCount(stated.factory) == 1
             ? EstimateScales<kNoiseKinds>(
                   stated, round, estimate, landmarks, track_noise)
             : EstimateScales<kMaxNoiseKinds>(
                   stated, round, estimate, landmarks, track_noise);
}

}  // namespace selfcal
