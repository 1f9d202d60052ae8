#include "core/calibration/linear_range.h"

#include <algorithm>
#include <cmath>

namespace selfcal {
namespace {

// The minimum is accurate enough when an iteration reduces the cost by less.
constexpr double kEnoughRange = 0.1 * kGrowthTolerance;

}  // namespace

LinearRange::LinearRange(const SolverRound& round,
                         const CalibrationEstimate& estimate,
                         const std::vector<ScreenedLandmark>& landmarks,
                         int max_iterations)
    : round_(round), estimate_(estimate), landmarks_(landmarks) {
  double last = 0;
  SolverRound settling = round_;
  settling.max_iterations = max_iterations;
  const SolverOutcome outcome = SolveRoundByStructure(
      settling,
      [&](int iteration, double cost, const Eigen::VectorXd&) {
        const bool enough = iteration > 0 && last - cost < kEnoughRange;
        last = cost;
        return enough ? SolverSignal::kEnough : SolverSignal::kGoOn;
      },
      &estimate_,
      &landmarks_);
  settled_ =
      outcome.status == SolverStatus::kConverged &&
      LineariseRound(round_, estimate_, landmarks_, &round_.loss, &linearised_);
}

bool LinearRange::Holds(const Eigen::VectorXd& step) const {
  const double information = step.dot(linearised_.by_offset.Lambda * step);
  if (!settled_ || !(information > 0)) {
    return false;
  }
  const Eigen::VectorXd sigma_step = step / std::sqrt(information);
  const double minimum = linearised_.by_offset.eta.dot(sigma_step);
  return GrowsAsClaimed(sigma_step, minimum - 1) &&
         GrowsAsClaimed(sigma_step, minimum + 1);
}

bool LinearRange::GrowsAsClaimed(const Eigen::VectorXd& sigma_step,
                                 double length) const {
  const double minimum = linearised_.by_offset.eta.dot(sigma_step);
  const double claimed =
      linearised_.cost + 0.5 * length * (length - 2 * minimum);
  const double tolerance = kGrowthTolerance * std::max(1.0, length * length);
  CalibrationEstimate estimate = estimate_;
  std::vector<ScreenedLandmark> landmarks = landmarks_;
  ApplyStep(linearised_, length * sigma_step, &estimate, &landmarks);
  double last = 0;
  SolverRound walk = round_;
  walk.max_iterations = kRangeIterations;
  // If the point on the tangent already costs no more than claimed, the
  // linearisation holds up to that point.
  const SolverOutcome outcome = SolveRoundByStructure(
      walk,
      [&](int iteration, double cost, const Eigen::VectorXd&) {
        const bool enough = iteration == 0 ? cost < claimed + tolerance
                                           : last - cost < kEnoughRange;
        last = cost;
        return enough ? SolverSignal::kEnough : SolverSignal::kGoOn;
      },
      &estimate,
      &landmarks);
  return outcome.status == SolverStatus::kConverged &&
         std::abs(outcome.final_cost - claimed) < tolerance;
}

ThetaSubspace TrustedSubspace(const Rig& rig,
                              const LinearRange& range,
                              double weak_information) {
  const Eigen::MatrixXd& Lambda = range.information().Lambda;
  const ThetaSubspace observed = ObservedSubspace(rig, Lambda, 0);
  const Eigen::MatrixXd basis = TangentBasis(rig, observed);
  Eigen::MatrixXd held = observed.held;
  for (int j = 0; j < basis.cols(); ++j) {
    const Eigen::VectorXd step = basis.col(j);
    if (step.dot(Lambda * step) < weak_information && !range.Holds(step)) {
      held.conservativeResize(Eigen::NoChange, held.cols() + 1);
      held.rightCols<1>() = observed.estimated.col(j);
    }
  }
  return HoldDirections(rig, Lambda, held);
}

}  // namespace selfcal
