#include "core/calibration/structured_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/calibration/landmark_position.h"
#include "core/calibration/theta_information.h"
#include "core/factor/link_batch.h"
#include "core/model/second_imu.h"

namespace selfcal {
namespace {

// A second length is tried if the minimum of the parabola through the first
// differs from it by more than this fraction.
constexpr double kLengthTolerance = 0.25;
// Weighted residuals overestimate the curvature of a robust cost: for the Huber
// loss at 2 sigma and normal residuals by 8 % in theta, by which every step
// would be too short. (Terms of the motion alone are not weighted.)
constexpr double kRobustStretch = 1.08;
constexpr double kMaxStretch = 2;
constexpr double kMinShortening = 0.1;
constexpr int kMaxTrials = 10;
// A step this short was deflected by weakly determined states, such as the tilt
// of a device that does not accelerate; these are then damped.
constexpr double kShort = 0.5;
constexpr double kDampingFactor = 1e2;
constexpr double kMaxDamping = 1e6;
// Landmarks at a trial point may together miss this fraction of the decrease
// that the step predicts.
constexpr double kRefineDecrease = 1e-4;

// First trial step of all unknowns.
struct Direction {
  Eigen::VectorXd d;
  std::vector<ChainStateVector> keyframes;
  std::vector<Eigen::Vector3d> landmarks;
  // Decrease of the cost per unit of length at the start of the line search.
  double slope = 0;
};

Direction FirstStep(const SolverRound& round,
                    const LinearisedRound& linearised) {
  const Eigen::MatrixXd& Lambda = linearised.by_offset.Lambda;
  const Eigen::VectorXd& eta = linearised.by_offset.eta;
  Direction direction;
  direction.d = Eigen::VectorXd::Zero(eta.size());
  if (round.basis.cols() > 0) {
    const Eigen::MatrixXd reduced =
        round.basis.transpose() * Lambda * round.basis;
    direction.d =
        round.basis * reduced.ldlt().solve(round.basis.transpose() * eta);
  }
  if (round.loss.kind != LossKind::kNone) {
    direction.d *= kRobustStretch;
  }
  const Eigen::VectorXd theta_step = linearised.theta_by_offset * direction.d;
  linearised.system.FindSteps(
      theta_step, &direction.keyframes, &direction.landmarks);
  direction.slope = linearised.system.decrease() + eta.dot(direction.d);
  return direction;
}

// Length at the minimum of the parabola through the start, with its slope, and
// the point at `length`, where the cost is higher by `rise`; limited to bounds.
double NextLength(double length, double rise, double slope) {
  const double curvature =
      2 * (rise + length * slope) / (length * length * slope);
  return curvature * kMaxStretch * length < 1
             ? kMaxStretch * length
             : std::max(1 / curvature, kMinShortening * length);
}

// A trial point of the line search, with its cost.
struct TrialPoint {
  CalibrationEstimate estimate;
  std::vector<LandmarkPosition> positions;
  double cost = 0;
};

std::vector<InertialNoiseRoot> RootsOf(const SolverRound& round) {
  std::vector<InertialNoiseRoot> roots;
  for (const InertialMatrix& W : round.whitening)
    roots.push_back(NoiseRootOf(W));
  return roots;
}

double MotionSquares(const SolverRound& round,
                     std::span<const InertialNoiseRoot> roots,
                     const ChainThetas& thetas,
                     const std::vector<KeyframeState>& keyframes) {
  double sum = 0;
  LinkBatch batch(WidestVectors());
  for (int t = 0; t < thetas.size(); ++t) {
    for (int imu = 0; imu < ImuCount(thetas[t]); ++imu) {
      std::vector<InertialLinkStates> links;
      std::vector<InertialNoiseRoot> of_links;
      for (std::size_t i = 0; i < roots.size(); ++i) {
        const InertialLink& link = round.problem.inertial_links[i];
        if (thetas.IndexOf(link.before) != t || link.imu != imu) continue;
        links.push_back(
            {&keyframes[link.before], &keyframes[link.after], link.samples});
        of_links.push_back(roots[i]);
      }
      std::vector<InertialResidual> residuals(links.size());
      batch.Residuals(
          links, thetas[t], imu, round.rig.gravity_mps2, of_links, residuals);
      for (const InertialResidual& r : residuals) sum += r.squaredNorm();
    }
  }
  for (const BiasLink& link : round.problem.bias_links) {
    const KeyframeState& a = keyframes[link.before];
    const KeyframeState& b = keyframes[link.after];
    Eigen::Matrix<double, 6, 1> walk;
    walk << b.b_a - a.b_a, b.b_g - a.b_g;
    sum += walk.cwiseQuotient(link.sigmas).squaredNorm();
  }
  return sum;
}

double Evaluate(const SolverRound& round,
                std::span<const InertialNoiseRoot> roots,
                const CalibrationEstimate& estimate,
                const std::vector<ScreenedLandmark>& landmarks,
                const RefineLimits& limits,
                std::vector<LandmarkPosition>* positions) {
  ChainThetas thetas(BoxPlus(round.reference, estimate.d), round.problem);
  double sum = MotionSquares(round, roots, thetas, estimate.keyframes);
  if (round.prior_information != nullptr) {
    sum += estimate.d.dot(*round.prior_information * estimate.d);
  }
  const LandmarkScene scene(std::move(thetas),
                            estimate.keyframes,
                            round.motions,
                            round.rig.pixel_sigma_px);
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    sum += landmarks[i].weight *
           RefinePosition(scene,
                          round.problem.tracks[landmarks[i].track],
                          landmarks[i].used,
                          round.loss,
                          limits,
                          &(*positions)[i])
               .cost;
  }
  return sum / 2;
}

std::vector<LandmarkPosition> Positions(
    const std::vector<ScreenedLandmark>& landmarks) {
  std::vector<LandmarkPosition> positions;
  positions.reserve(landmarks.size());
  for (const ScreenedLandmark& landmark : landmarks) {
    positions.push_back(landmark.position);
  }
  return positions;
}

}  // namespace

double RoundCost(const SolverRound& round,
                 const CalibrationEstimate& estimate,
                 const std::vector<ScreenedLandmark>& landmarks) {
  std::vector<LandmarkPosition> positions = Positions(landmarks);
  return Evaluate(
      round, RootsOf(round), estimate, landmarks, {.steps = 0}, &positions);
}

bool LineariseFactors(const SolverRound& round,
                      const CalibrationEstimate& estimate,
                      const std::vector<ScreenedLandmark>& landmarks,
                      const RobustLoss* loss,
                      LinearisedRound* result,
                      double damping) {
  const ChainThetas thetas(BoxPlus(round.reference, estimate.d), round.problem);
  result->theta_by_offset = ThetaByOffset(round.reference, estimate.d);
  result->roots = RootsOf(round);
  result->system.Linearise({round.rig,
                            thetas,
                            round.problem,
                            estimate.keyframes,
                            round.motions,
                            landmarks},
                           result->roots,
                           loss,
                           damping);
  const SharedInformation& at_theta = result->system.information();
  if (!at_theta.Lambda.allFinite() || !at_theta.eta.allFinite()) {
    return false;
  }
  result->by_offset = ByOffset(at_theta, result->theta_by_offset);
  if (round.prior_information != nullptr) {
    result->by_offset.Lambda += *round.prior_information;
    result->by_offset.eta -= *round.prior_information * estimate.d;
  }
  return true;
}

bool LineariseRound(const SolverRound& round,
                    const CalibrationEstimate& estimate,
                    const std::vector<ScreenedLandmark>& landmarks,
                    const RobustLoss* loss,
                    LinearisedRound* result,
                    double damping) {
  if (!LineariseFactors(round, estimate, landmarks, loss, result, damping)) {
    return false;
  }
  result->cost = RoundCost(round, estimate, landmarks);
  return true;
}

namespace {

// Tries points along one direction from the estimate.
class LineSearch {
 public:
  LineSearch(const SolverRound& round,
             const LinearisedRound& linearised,
             const CalibrationEstimate& estimate,
             const std::vector<ScreenedLandmark>& landmarks)
      : round_(round),
        linearised_(linearised),
        direction_(FirstStep(round, linearised)),
        estimate_(estimate),
        landmarks_(landmarks),
        positions_(Positions(landmarks)) {}

  // Returns the trial point of lowest cost, which may be above that of the
  // start. Further lengths are tried until one decreases the cost.
  TrialPoint Run() {
    TrialPoint best = At(1);
    length_ = 1;
    double next = Next(1, best);
    if (Lower(best) && std::abs(next - 1) <= kLengthTolerance) return best;
    for (int i = 0; i < kMaxTrials && (i == 0 || !Lower(best)); ++i) {
      const double length = next;
      TrialPoint trial = At(length);
      next = Next(length, trial);
      if (trial.cost < best.cost) {
        best = std::move(trial);
        length_ = length;
      }
    }
    return best;
  }

  bool Lower(const TrialPoint& trial) const {
    return trial.cost < linearised_.cost;
  }
  // Length of the best trial point.
  double length() const { return length_; }

 private:
  double Next(double length, const TrialPoint& trial) const {
    return NextLength(length, trial.cost - linearised_.cost, direction_.slope);
  }

  TrialPoint At(double length) const {
    TrialPoint trial{estimate_, positions_, 0};
    trial.estimate.d += length * direction_.d;
    for (std::size_t k = 0; k < direction_.keyframes.size(); ++k) {
      KeyframeState& x = trial.estimate.keyframes[k];
      x = BoxPlus(x, length * direction_.keyframes[k]);
    }
    for (std::size_t i = 0; i < direction_.landmarks.size(); ++i) {
      trial.positions[i].Move(length * direction_.landmarks[i]);
    }
    const RefineLimits limits{.decrease =
                                  kRefineDecrease * direction_.slope /
                                  static_cast<double>(landmarks_.size() + 1)};
    trial.cost = Evaluate(round_,
                          linearised_.roots,
                          trial.estimate,
                          landmarks_,
                          limits,
                          &trial.positions);
    return trial;
  }

  const SolverRound& round_;
  const LinearisedRound& linearised_;
  const Direction direction_;
  const CalibrationEstimate& estimate_;
  const std::vector<ScreenedLandmark>& landmarks_;
  const std::vector<LandmarkPosition> positions_;
  double length_ = 0;
};

}  // namespace

StepOutcome TakeStep(const SolverRound& round,
                     const LinearisedRound& linearised,
                     CalibrationEstimate* estimate,
                     std::vector<ScreenedLandmark>* landmarks) {
  LineSearch search(round, linearised, *estimate, *landmarks);
  TrialPoint best = search.Run();
  double length = search.length();
  LinearisedRound damped;
  for (double damping = 1; length < kShort && damping <= kMaxDamping;
       damping *= kDampingFactor) {
    if (!LineariseRound(
            round, *estimate, *landmarks, &round.loss, &damped, damping)) {
      break;
    }
    LineSearch damped_search(round, damped, *estimate, *landmarks);
    TrialPoint trial = damped_search.Run();
    length = damped_search.length();
    if (trial.cost < best.cost) best = std::move(trial);
  }
  if (!search.Lower(best)) {
    return {false, linearised.cost};
  }
  *estimate = std::move(best.estimate);
  for (std::size_t i = 0; i < landmarks->size(); ++i) {
    (*landmarks)[i].position = best.positions[i];
  }
  return {true, best.cost};
}

void ApplyStep(const LinearisedRound& linearised,
               const Eigen::VectorXd& step_d,
               CalibrationEstimate* estimate,
               std::vector<ScreenedLandmark>* landmarks) {
  std::vector<ChainStateVector> keyframes;
  std::vector<Eigen::Vector3d> positions;
  linearised.system.FindSteps(
      linearised.theta_by_offset * step_d, &keyframes, &positions);
  estimate->d += step_d;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    KeyframeState& x = estimate->keyframes[k];
    x = BoxPlus(x, keyframes[k]);
  }
  for (std::size_t i = 0; i < positions.size(); ++i) {
    (*landmarks)[i].position.Move(positions[i]);
  }
}

SolverOutcome SolveRoundByStructure(const SolverRound& round,
                                    const SolverCallback& callback,
                                    CalibrationEstimate* estimate,
                                    std::vector<ScreenedLandmark>* landmarks) {
  SolverOutcome outcome;
  LinearisedRound linearised;
  const auto end = [&](SolverStatus status) {
    outcome.status = status;
    return outcome;
  };
  for (;; ++outcome.iterations) {
    if (!LineariseRound(
            round, *estimate, *landmarks, &round.loss, &linearised)) {
      outcome.message = "the states of the keyframes are not determined";
      return end(SolverStatus::kFailed);
    }
    const double last_cost = outcome.final_cost;
    outcome.final_cost = linearised.cost;
    if (outcome.iterations == 0) {
      outcome.initial_cost = linearised.cost;
    }
    switch (callback(outcome.iterations, linearised.cost, estimate->d)) {
      case SolverSignal::kEnough:
        return end(SolverStatus::kConverged);
      case SolverSignal::kCancel:
        return end(SolverStatus::kCancelled);
      case SolverSignal::kGoOn:
        break;
    }
    if (outcome.iterations > 0 &&
        last_cost - linearised.cost <= round.function_tolerance * last_cost) {
      return end(SolverStatus::kConverged);
    }
    if (outcome.iterations == round.max_iterations) {
      return end(SolverStatus::kNotConverged);
    }
    if (!TakeStep(round, linearised, estimate, landmarks).lower) {
      return end(SolverStatus::kConverged);
    }
  }
}

}  // namespace selfcal
