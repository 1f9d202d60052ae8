#include "core/calibration/noise_factors.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/calibration/structured_solver.h"
#include "core/calibration/theta_information.h"

namespace selfcal {
namespace {

using Kinds = Eigen::Matrix<double, kNoiseKinds, 1>;
using KindsMatrix = Eigen::Matrix<double, kNoiseKinds, kNoiseKinds>;
using MotionMatrix = Eigen::Matrix<double, 9, 9>;

constexpr int At(NoiseKind kind) { return static_cast<int>(kind); }

// Of the noise of one link's motion at unit factors, what each sensor brings.
struct MotionNoise {
  MotionMatrix gyro, accel;
};

std::vector<MotionNoise> SplitMotionNoise(
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

// Squares and redundancy of each kind, both for whitening by given factors.
struct Balance {
  Kinds squares, redundancy;
};

class FactorProblem {
 public:
  FactorProblem(const SolverRound& round,
                const CalibrationEstimate& estimate,
                const std::vector<ScreenedLandmark>& landmarks)
      : round_(round),
        estimate_(estimate),
        landmarks_(landmarks),
        rig_(round.rig),
        problem_(round.problem),
        whitening_(round.whitening),
        motion_(SplitMotionNoise(round,
                                 BoxPlus(round.reference, estimate.d).imu,
                                 estimate.keyframes)) {}

  // Nothing where the linear system fails.
  std::optional<Balance> Evaluate(const Kinds& log_factors) {
    const Kinds factors = log_factors.array().exp();
    Scale(factors);
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
    if (!LineariseRound(round, estimate_, landmarks_, &loss, &linearised_)) {
      return std::nullopt;
    }
    return Count(factors, loss);
  }

 private:
  void Scale(const Kinds& factors) {
    for (int i = 0; i < kNoiseKinds; ++i) {
      const auto kind = static_cast<NoiseKind>(i);
      Rig believed = round_.rig;
      *NoiseOf(kind, &rig_) = factors[i] * *NoiseOf(kind, &believed);
    }
    const double gyro = factors[At(NoiseKind::kGyro)];
    const double accel = factors[At(NoiseKind::kAccel)];
    InertialResidual walks = InertialResidual::Zero();
    walks.segment<3>(9).setConstant(factors[At(NoiseKind::kAccelBiasWalk)]);
    walks.segment<3>(12).setConstant(factors[At(NoiseKind::kGyroBiasWalk)]);
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

  Balance Count(const Kinds& factors, const RobustLoss& loss) {
    // The step of theta that minimises, and its covariance.
    const Eigen::MatrixXd basis = linearised_.theta_by_offset * round_.basis;
    const SharedInformation& by_offset = linearised_.by_offset;
    const Eigen::LLT<Eigen::MatrixXd> reduced(round_.basis.transpose() *
                                              by_offset.Lambda * round_.basis);
    const Eigen::VectorXd step =
        reduced.solve(round_.basis.transpose() * by_offset.eta);
    const Eigen::MatrixXd inverse = reduced.solve(
        Eigen::MatrixXd::Identity(reduced.rows(), reduced.cols()));
    const LinearPosterior posterior = linearised_.system.FindPosterior(
        basis * step, basis * inverse * basis.transpose(), landmarks_);
    Balance balance = {Kinds::Zero(), Kinds::Zero()};
    AddMotion(factors, posterior, &balance);

    AddPixels(posterior,
              posterior.unknowns + static_cast<double>(basis.cols()) -
                  AbsorbedByPrior(inverse),
              loss,
              &balance);
    return balance;
  }

  // Of the prior on theta, if there is one.
  double AbsorbedByPrior(const Eigen::MatrixXd& inverse) const {
    if (round_.prior_information == nullptr) return 0;
    return inverse
        .cwiseProduct(round_.basis.transpose() * *round_.prior_information *
                      round_.basis)
        .sum();
  }

  void AddMotion(const Kinds& factors,
                 const LinearPosterior& posterior,
                 Balance* balance) const {
    const auto add = [&](NoiseKind kind, double squares, double redundancy) {
      balance->squares[At(kind)] += squares;
      balance->redundancy[At(kind)] += redundancy;
    };
    const double gyro = factors[At(NoiseKind::kGyro)];
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
  void AddPixels(const LinearPosterior& posterior,
                 double unknowns,
                 const RobustLoss& loss,
                 Balance* balance) const {
    double absorbed = unknowns - posterior.prior_absorbed - posterior.walk_rows;
    for (const ChainStateMatrix& C : posterior.inertial_covariance) {
      absorbed -= C.trace();
    }
    absorbed += posterior.walk_redundancy.sum();
    // Observations of less weight count less, and what is absorbed of them.
    const double weight =
        posterior.weighted_observations / posterior.observations;
    absorbed = weight * (absorbed - 3 * posterior.landmarks) +
               3 * posterior.weighted_landmarks;
    const double rows = 2 * posterior.weighted_observations;
    const double redundancy = rows - absorbed;
    balance->redundancy[At(NoiseKind::kPixel)] = redundancy;
    balance->squares[At(NoiseKind::kPixel)] =
        posterior.pixel_squares / Consistency(loss, redundancy / rows);
  }

  const SolverRound& round_;
  const CalibrationEstimate& estimate_;
  const std::vector<ScreenedLandmark>& landmarks_;
  // Scaled by the factors at hand.
  Rig rig_;
  CalibrationProblem problem_;
  std::vector<InertialMatrix> whitening_;
  const std::vector<MotionNoise> motion_;
  LinearisedRound linearised_;
};

constexpr double kMedianOfRayleigh = 1.1774100225154747;
// Where nothing is known about a factor, its logarithm is within so much of
// zero.
const double kPriorLogSigma = std::log(10.0);
constexpr double kDifference = 0.1;  // of logarithms
constexpr double kLongestStep = 1.5;
constexpr int kMaxSteps = 15;
// Settled when the next step is shorter, in standard deviations.
constexpr double kSettledSigmas = 0.02;
// A Fisher information taken further away than this is taken again.
constexpr double kNear = 0.3;

// Score and Fisher information of the logarithms of the factors, with the
// prior. The Fisher information of a restricted likelihood follows from how the
// redundancies change with the factors.
class Likelihood {
 public:
  explicit Likelihood(FactorProblem* problem) : problem_(problem) {}

  bool MoveTo(const Kinds& at) {
    const std::optional<Balance> balance = problem_->Evaluate(at);
    if (!balance) return false;
    at_ = at;
    balance_ = *balance;
    return true;
  }

  const Kinds& at() const { return at_; }
  const Balance& balance() const { return balance_; }

  // For squares that fall with the square of the factor, linear in its
  // logarithm.
  Kinds Score() const {
    const Kinds& r = balance_.redundancy;
    return r.array() * (balance_.squares.array() / r.array()).max(1e-12).log() -
           at_.array() * Prior();
  }

  std::optional<KindsMatrix> Fisher() const {
    KindsMatrix by_factor;
    by_factor.col(0).setZero();
    static_assert(At(NoiseKind::kPixel) == 0);
    for (int i = 1; i < kNoiseKinds; ++i) {
      const std::optional<Balance> moved =
          problem_->Evaluate(at_ + kDifference * Kinds::Unit(i));
      if (!moved) return std::nullopt;
      by_factor.col(i) =
          (moved->redundancy - balance_.redundancy) / kDifference;
      // Nothing changes where all factors change alike.
      by_factor.col(0) -= by_factor.col(i);
    }
    KindsMatrix fisher = -0.5 * (by_factor + by_factor.transpose());
    fisher.diagonal() += 2 * balance_.redundancy;
    // What differences leave of nothing may be less than that.
    const Eigen::SelfAdjointEigenSolver<KindsMatrix> eigen(fisher);
    return eigen.eigenvectors() *
           (eigen.eigenvalues().array().max(0) + Prior())
               .matrix()
               .asDiagonal() *
           eigen.eigenvectors().transpose();
  }

 private:
  static double Prior() { return 1 / (kPriorLogSigma * kPriorLogSigma); }

  FactorProblem* problem_;
  Kinds at_ = Kinds::Zero();
  Balance balance_;
};

// Scoring, the information corrected by what each step shows (Broyden).
std::optional<KindsMatrix> Maximise(Likelihood* likelihood) {
  std::optional<KindsMatrix> fisher = likelihood->Fisher();
  if (!fisher) return std::nullopt;
  const Kinds informed_at = likelihood->at();
  KindsMatrix slope = *fisher;
  for (int i = 0; i < kMaxSteps; ++i) {
    const Kinds score = likelihood->Score();
    Kinds step = slope.partialPivLu().solve(score);
    step *= std::min(1.0, kLongestStep / step.lpNorm<Eigen::Infinity>());
    if (std::sqrt(step.dot(*fisher * step)) < kSettledSigmas) break;
    if (!likelihood->MoveTo(likelihood->at() + step)) return std::nullopt;
    const Kinds change = score - likelihood->Score();
    slope += (change - slope * step) * step.transpose() / step.squaredNorm();
  }
  if ((likelihood->at() - informed_at).lpNorm<Eigen::Infinity>() > kNear) {
    fisher = likelihood->Fisher();
  }
  return fisher;
}

}  // namespace

std::vector<NoiseFactor> EstimateNoiseFactors(
    const SolverRound& round,
    const CalibrationEstimate& estimate,
    const std::vector<ScreenedLandmark>& landmarks) {
  FactorProblem problem(round, estimate, landmarks);
  Likelihood likelihood(&problem);
  const ReprojectionStatistics pixels =
      MeasureReprojection(round.rig,
                          BoxPlus(round.reference, estimate.d),
                          round.problem,
                          estimate.keyframes,
                          round.motions,
                          landmarks);
  Kinds start = Kinds::Zero();
  if (pixels.median_px > 0) {
    start[At(NoiseKind::kPixel)] = std::log(
        pixels.median_px / kMedianOfRayleigh / round.rig.pixel_sigma_px);
  }
  if (!likelihood.MoveTo(start)) return {};
  const std::optional<KindsMatrix> fisher = Maximise(&likelihood);
  if (!fisher) return {};
  const KindsMatrix covariance = fisher->inverse();
  std::vector<NoiseFactor> factors;
  for (int i = 0; i < kNoiseKinds; ++i) {
    factors.push_back({static_cast<NoiseKind>(i),
                       std::exp(likelihood.at()[i]),
                       std::sqrt(covariance(i, i)),
                       likelihood.balance().redundancy[i]});
  }
  return factors;
}

}  // namespace selfcal
