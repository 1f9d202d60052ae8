#include "core/calibration/descent.h"

#include <utility>

#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"

namespace selfcal {
namespace {

// Limits the number of rounds; usually they converge after two to four.
constexpr int kMaxDescentRounds = 12;
// The first round only has to come near enough to detect outliers.
constexpr double kFirstTolerance = 1e-4;
constexpr double kTolerance = 1e-8;
// Largest undamped Gauss-Newton step of theta at convergence, in sigmas.
constexpr double kMaxStepSigmas = 0.05;
// A round ends after this many consecutive steps of theta below
// kSmallStepSigmas: landmarks of low weight may keep drifting for long without
// any effect; so may an unobservable scale of the scene, along which an
// undamped step goes far beyond its linear range.
constexpr int kSmallSteps = 3;
constexpr double kSmallStepSigmas = 0.005;
// Damping that is negligible for states that are determined.
constexpr double kSettledDamping = 1;
// A step is small only if it reduces the cost by less than this [half squares].
constexpr double kSmallDecrease = 0.1;
// Largest change of theta by a round at convergence, in sigmas.
constexpr double kMaxRoundSigmas = 0.02;

}  // namespace

Descent::Descent(const CalibrateOptions& options,
                 const Calibration& theta_start,
                 const ProgressCallback& progress,
                 WorkingPoint* point)
    : options_(options),
      theta_start_(theta_start),
      progress_(progress),
      point_(point) {}

bool Descent::Start() {
  if (!point_->FindSubspace()) return FailUndetermined();
  state_.initial_cost = state_.final_cost = point_->linearised().cost;
  return true;
}

bool Descent::Descend() {
  state_.status = CalibrateStatus::kNotConverged;
  return options_.solver == SolverKind::kStructured ? DescendBySteps()
                                                    : DescendByRounds();
}

bool Descent::Repeat() {
  return point_->RepeatSelection() ? Descend() : FailUndetermined();
}

bool Descent::DescendHolding(ThetaSubspace subspace) {
  return point_->HoldAssessed(std::move(subspace)) ? Descend()
                                                   : FailUndetermined();
}

// Selects and relinearises after every step.
bool Descent::DescendBySteps() {
  if (!Report(state_.iterations, state_.final_cost, 0, point_->estimate().d)) {
    return Cancel();
  }
  int small_steps = 0;
  for (;;) {
    const double undamped_sigmas = point_->StepSigmas();
    const double cost_before = point_->linearised().cost;
    const Eigen::VectorXd d_before = point_->estimate().d;
    const StepOutcome step = point_->Step();
    state_.final_cost = step.cost;
    ++state_.iterations;
    const double moved_sigmas =
        LargestInSigmas(point_->estimate().d - d_before, point_->covariance());
    if (!Report(state_.iterations,
                state_.final_cost,
                moved_sigmas,
                point_->estimate().d)) {
      return Cancel();
    }
    const bool small = step.lower && moved_sigmas < kSmallStepSigmas &&
                       cost_before - step.cost < kSmallDecrease;
    small_steps = small ? small_steps + 1 : 0;
    if (undamped_sigmas < kMaxStepSigmas) {
      state_.status = CalibrateStatus::kConverged;
      return true;
    }
    if (!step.lower || small_steps == kSmallSteps) {
      state_.status =
          IsSettled() ? CalibrateStatus::kConverged : CalibrateStatus::kStalled;
      return true;
    }
    if (state_.iterations >= options_.max_iterations) return true;
    if (!point_->RepeatSelection()) return FailUndetermined();
  }
}

// Returns true if theta would not move, provided that weakly determined states
// do not leave their linear range: in an undamped step these drag theta along,
// and no such step is ever accepted.
bool Descent::IsSettled() {
  const Rig& rig = point_->rig();
  const ThetaSubspace& subspace = point_->subspace();
  const Eigen::MatrixXd basis = TangentBasis(rig, subspace);
  LinearisedRound damped;
  if (!LineariseRound(point_->Round(basis),
                      point_->estimate(),
                      point_->screening().landmarks,
                      &point_->screening().loss,
                      &damped,
                      kSettledDamping)) {
    return false;
  }
  const SharedInformation& at = damped.by_offset;
  state_.remaining_sigmas =
      LargestInSigmas(SubspaceStep(rig, subspace, at.Lambda, at.eta),
                      SubspaceCovariance(rig, subspace, at.Lambda));
  return state_.remaining_sigmas < kMaxStepSigmas;
}

bool Descent::DescendByRounds() {
  for (int round = 0; round < kMaxDescentRounds; ++round) {
    const Eigen::VectorXd d_before = point_->estimate().d;
    const SolverOutcome outcome = SolveOneRound(round);
    if (outcome.status == SolverStatus::kCancelled) return Cancel();
    if (outcome.status == SolverStatus::kFailed) return Fail(outcome.message);
    if (!point_->Linearise()) return FailUndetermined();
    const double moved_sigmas =
        LargestInSigmas(point_->estimate().d - d_before, point_->covariance());
    const bool same = point_->ChooseSubspace();
    if (round > 0 && same && moved_sigmas < kMaxRoundSigmas &&
        point_->StepSigmas() < kMaxStepSigmas) {
      state_.status = CalibrateStatus::kConverged;
      return true;
    }
    if (state_.iterations >= options_.max_iterations) return true;
    point_->SelectAfresh();
  }
  return true;
}

SolverOutcome Descent::SolveOneRound(int round_number) {
  Eigen::VectorXd d_last = point_->estimate().d;
  int small_steps = 0;
  const auto report =
      [&](int iteration, double cost, const Eigen::VectorXd& d) {
        const double step = LargestInSigmas(d - d_last, point_->covariance());
        d_last = d;
        // A rejected step does not move theta, and is ignored.
        if (step > 0) {
          small_steps = step < kSmallStepSigmas ? small_steps + 1 : 0;
        }
        if (!Report(state_.iterations + iteration, cost, step, d)) {
          return SolverSignal::kCancel;
        }
        return small_steps >= kSmallSteps ? SolverSignal::kEnough
                                          : SolverSignal::kGoOn;
      };
  const SolverOutcome outcome =
      point_->SolveRound(options_.max_iterations - state_.iterations,
                         round_number == 0 ? kFirstTolerance : kTolerance,
                         report);
  if (round_number == 0) state_.initial_cost = outcome.initial_cost;
  state_.final_cost = outcome.final_cost;
  state_.iterations += outcome.iterations;
  return outcome;
}

bool Descent::Report(int iteration,
                     double cost,
                     double step_sigmas,
                     const Eigen::VectorXd& d) const {
  if (!progress_) return true;
  const Calibration theta = BoxPlus(point_->reference(), d);
  const Eigen::VectorXd variances =
      CovarianceWithHeld(
          point_->rig(), point_->subspace(), point_->information().Lambda)
          .diagonal();
  return progress_({.iteration = iteration,
                    .max_iterations = options_.max_iterations,
                    .cost = cost,
                    .step_sigmas = step_sigmas,
                    .theta = theta,
                    .moved = BoxMinus(theta, theta_start_),
                    .sigmas = variances.cwiseMax(0).cwiseSqrt()});
}

bool Descent::Cancel() {
  state_.status = CalibrateStatus::kCancelled;
  state_.message = "cancelled";
  return false;
}

bool Descent::Fail(const std::string& message) {
  state_.status = CalibrateStatus::kFailed;
  state_.message = message;
  return false;
}

bool Descent::FailUndetermined() {
  return Fail("the states of the keyframes are not determined");
}

}  // namespace selfcal
