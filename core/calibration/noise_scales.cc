#include "core/calibration/noise_scales.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/calibration/noise_balance.h"
#include "core/calibration/track_noise.h"

namespace selfcal {
namespace {

using NoiseMatrix = Eigen::Matrix<double, kNoiseKinds, kNoiseKinds>;

constexpr double Square(double x) { return x * x; }

constexpr double kMedianOfRayleigh = 1.1774100225154747;
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
NoiseMatrix PriorInformation() {
  NoiseMatrix covariance = NoiseMatrix::Constant(Square(kPriorLogSigma) -
                                                 Square(kConditionalLogSigma));
  constexpr int kPixel = IndexOf(NoiseKind::kPixel);
  covariance.row(kPixel).setZero();
  covariance.col(kPixel).setZero();
  covariance.diagonal().setConstant(Square(kPriorLogSigma));
  return covariance.inverse();
}

// Score and Fisher information of the logarithms of the noise scales, including
// the prior. The Fisher information of a restricted likelihood follows from the
// derivatives of the redundancies with respect to the scales.
class Likelihood {
 public:
  // `taken`: logarithms of the noise of the problem relative to the stated
  // noise.
  Likelihood(NoiseProblem* problem, const NoiseVector& taken)
      : problem_(problem), taken_(taken) {}

  bool MoveTo(const NoiseVector& at) {
    const std::optional<NoiseBalance> balance = problem_->Evaluate(at);
    if (!balance) return false;
    at_ = at;
    balance_ = *balance;
    return true;
  }

  const NoiseVector& at() const { return at_; }
  const NoiseBalance& balance() const { return balance_; }

  NoiseVector Score() const {
    return balance_.squares - balance_.redundancy - prior_ * (taken_ + at_);
  }

  // Computed from two differences: a walk interacts with the noise of its own
  // sensor only, so that the noise of each sensor is varied together with the
  // walk of the other.
  std::optional<NoiseMatrix> Fisher() const {
    constexpr int kPixel = IndexOf(NoiseKind::kPixel);
    constexpr int kGyro = IndexOf(NoiseKind::kGyro);
    constexpr int kAccel = IndexOf(NoiseKind::kAccel);
    constexpr int kGyroWalk = IndexOf(NoiseKind::kGyroBiasWalk);
    constexpr int kAccelWalk = IndexOf(NoiseKind::kAccelBiasWalk);
    const bool pixels_count = problem_->PixelsCount();
    const auto a = Difference(kGyro, kAccelWalk);
    const auto b = Difference(kAccel, kGyroWalk);
    if (!a || !b) return std::nullopt;
    NoiseMatrix by_factor = NoiseMatrix::Zero();
    by_factor(kGyro, kGyro) = (*a)[kGyro];
    by_factor(kAccel, kAccel) = (*b)[kAccel];
    by_factor(kGyroWalk, kGyroWalk) = (*b)[kGyroWalk];
    by_factor(kAccelWalk, kAccelWalk) = (*a)[kAccelWalk];
    const double gyro_and_walk = (*a)[kGyroWalk];
    const double accel_and_walk = (*b)[kAccelWalk];
    SetBoth(kGyro, kGyroWalk, gyro_and_walk, &by_factor);
    SetBoth(kAccel, kAccelWalk, accel_and_walk, &by_factor);
    SetBoth(kGyro,
            kAccel,
            0.5 * ((*a)[kAccel] - accel_and_walk + (*b)[kGyro] - gyro_and_walk),
            &by_factor);
    // Redundancies do not change if all noise scales change by the same factor.
    if (pixels_count) {
      for (int i = 1; i < kNoiseKinds; ++i) {
        SetBoth(kPixel, i, -by_factor.row(i).sum(), &by_factor);
      }
      by_factor(kPixel, kPixel) = -by_factor.row(kPixel).sum();
    }
    NoiseMatrix fisher = -by_factor;
    fisher.diagonal() += 2 * balance_.redundancy;
    // Differences may turn a zero eigenvalue into a negative one.
    const Eigen::SelfAdjointEigenSolver<NoiseMatrix> eigen(fisher);
    return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() *
               eigen.eigenvectors().transpose() +
           prior_;
  }

 private:
  static void SetBoth(int i, int j, double value, NoiseMatrix* matrix) {
    (*matrix)(i, j) = (*matrix)(j, i) = value;
  }

  // Difference quotient of the redundancies for a common change of the
  // logarithms of two noise scales.
  std::optional<NoiseVector> Difference(int i, int j) const {
    const std::optional<NoiseBalance> moved = problem_->Evaluate(
        at_ + kDifference * (NoiseVector::Unit(i) + NoiseVector::Unit(j)));
    if (!moved) return std::nullopt;
    return (moved->redundancy - balance_.redundancy) / kDifference;
  }

  NoiseProblem* problem_;
  const NoiseVector taken_;
  const NoiseMatrix prior_ = PriorInformation();
  NoiseVector at_ = NoiseVector::Zero();
  NoiseBalance balance_;
};

// The Fisher information and the point at which it was computed.
struct FisherEvaluation {
  NoiseMatrix fisher;
  NoiseVector at, redundancy;
};

std::optional<FisherEvaluation> EvaluateFisher(const Likelihood& likelihood) {
  const std::optional<NoiseMatrix> fisher = likelihood.Fisher();
  if (!fisher) return std::nullopt;
  return FisherEvaluation{
      *fisher, likelihood.at(), likelihood.balance().redundancy};
}

bool StillHolds(const FisherEvaluation& evaluation,
                const Likelihood& likelihood) {
  for (int i = 0; i < kNoiseKinds; ++i) {
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
bool IsSettled(const NoiseVector& change, const FisherEvaluation& evaluation) {
  const NoiseMatrix covariance = evaluation.fisher.inverse();
  for (int i = 0; i < kNoiseKinds; ++i) {
    const double allowed = evaluation.redundancy[i] > kMayBeDetermined
                               ? kSettledSigmas
                               : kSettledSigmasOfGuess;
    if (std::abs(change[i]) > allowed * std::sqrt(covariance(i, i))) {
      return false;
    }
  }
  return true;
}

struct Maximum {
  NoiseMatrix fisher;
  bool converged = false;
};

// Fisher scoring of the variances, in which the expected squares are linear:
// the first step comes near the maximum from anywhere. The information is then
// corrected by the observed change of the score in each step (Broyden). A step
// that does not bring the score nearer to zero, in its own standard deviations,
// is halved. Returns nullopt if the linear system fails.
std::optional<Maximum> Maximise(Likelihood* likelihood) {
  std::optional<FisherEvaluation> evaluation = EvaluateFisher(*likelihood);
  if (!evaluation) return std::nullopt;
  NoiseMatrix slope = evaluation->fisher;
  const auto size_of = [&](const NoiseVector& score) {
    return std::sqrt(score.dot(evaluation->fisher.ldlt().solve(score)));
  };
  for (int i = 0; i < kMaxSteps; ++i) {
    const NoiseVector score = likelihood->Score();
    NoiseVector change = slope.partialPivLu().solve(score);
    if (!change.allFinite() || change.dot(score) <= 0) {
      slope = evaluation->fisher;
      change = slope.ldlt().solve(score);
    }
    if (IsSettled(change, *evaluation))
      return Maximum{evaluation->fisher, true};
    const NoiseVector from = likelihood->at();
    NoiseVector step = (0.5 * (1 + 2 * change.array()).max(kLeastPart).log())
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
      const NoiseVector shown = score - likelihood->Score();
      slope += (shown - slope * step) * step.transpose() / step.squaredNorm();
    } else {
      evaluation = EvaluateFisher(*likelihood);
      if (!evaluation) return std::nullopt;
      slope = evaluation->fisher;
    }
  }
  return Maximum{evaluation->fisher, false};
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
  const double rows =
      3.0 * static_cast<double>(round.problem.inertial_links.size());
  return std::min(
      1.0,
      scales[IndexOf(NoiseKind::kGyro)].redundancy / (kImagesDecide * rows));
}

// The maximum from this start. Takes the problem, whose linear system is large,
// so that it ends here.
std::vector<NoiseScale> ScalesFrom(const NoiseVector& start,
                                   const NoiseVector& taken,
                                   NoiseProblem problem) {
  Likelihood likelihood(&problem, taken);
  if (!likelihood.MoveTo(start)) return {};
  const std::optional<Maximum> maximum = Maximise(&likelihood);
  if (!maximum) return {};
  const NoiseMatrix covariance = maximum->fisher.inverse();
  std::vector<NoiseScale> scales;
  for (int i = 0; i < kNoiseKinds; ++i) {
    const double redundancy = likelihood.balance().redundancy[i];
    // The information may have been computed at a distant point.
    const double least = 1 / (2 * redundancy + PriorInformation()(i, i));
    scales.push_back({static_cast<NoiseKind>(i),
                      std::exp(likelihood.at()[i]),
                      std::sqrt(std::max(covariance(i, i), least)),
                      redundancy,
                      1,
                      maximum->converged});
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
  NoiseVector taken;
  for (int i = 0; i < kNoiseKinds; ++i) {
    const auto kind = static_cast<NoiseKind>(i);
    taken[i] = std::log(NoiseOf(kind, round.rig) / NoiseOf(kind, stated));
  }
  NoiseVector start = NoiseVector::Zero();
  start[IndexOf(NoiseKind::kPixel)] =
      std::log(GuessPixelFactor(round, estimate, landmarks));
  std::vector<NoiseScale> scales = ScalesFrom(
      start, taken, NoiseProblem(round, estimate, landmarks, track_noise));
  if (scales.empty()) return scales;
  const double successive = SuccessiveNoiseRatio(round, estimate, landmarks);
  if (track_noise < kMuchInCommon * scales[IndexOf(NoiseKind::kPixel)].factor &&
      kMuchInCommon * successive > 1) {
    return scales;
  }
  for (int i = 0; i < kNoiseKinds; ++i) start[i] = std::log(scales[i].factor);
  const std::vector<NoiseScale> others = ScalesFrom(
      start,
      taken,
      NoiseProblem(round,
                   estimate,
                   landmarks,
                   0,
                   std::pow(successive, ShareOfImages(round, scales))));
  if (others.empty()) return {};
  for (const NoiseKind kind : {NoiseKind::kGyro, NoiseKind::kAccel}) {
    const NoiseScale& other = others[IndexOf(kind)];
    NoiseScale& scale = scales[IndexOf(kind)];
    if (other.factor > scale.factor) scale = other;
  }
  return scales;
}

}  // namespace selfcal
