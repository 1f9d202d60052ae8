// Descent of a working point to the minimum, by steps of the structured solver
// or by rounds of Ceres. Observations are selected again on the way, so that
// the minimum is a fixed point that does not depend on the path to it.
#pragma once

#include <Eigen/Core>
#include <string>

#include "core/calibration/calibrate.h"
#include "core/calibration/working_point.h"
#include "core/model/calibration.h"

namespace selfcal {

// How a calibration goes, or how it ended.
struct DescentState {
  CalibrateStatus status = CalibrateStatus::kNotConverged;
  std::string message;
  int iterations = 0;  // of all descents
  double initial_cost = 0;
  double final_cost = 0;
  // If it is stalled: the largest component of the next step, in sigmas.
  double remaining_sigmas = 0;
};

// One descent follows another as the weights or the directions change. All
// arguments must outlive it.
class Descent {
 public:
  Descent(const CalibrateOptions& options,
          const Calibration& theta_start,
          const ProgressCallback& progress,
          WorkingPoint* point);

  // The following functions return false if the calibration ends without a
  // result: cancelled, or failed.

  bool Start();  // finds the directions that the data observes
  // Descends to the minimum with the present weights and directions. True also
  // if it stalls or runs out of iterations: see state().
  bool Descend();
  // Selects again and descends, after weights have changed.
  bool Repeat();
  // Holds directions (WorkingPoint::HoldAssessed) and descends.
  bool DescendHolding(ThetaSubspace subspace);

  const DescentState& state() const { return state_; }
  bool converged() const {
    return state_.status == CalibrateStatus::kConverged;
  }

 private:
  bool DescendBySteps();
  bool DescendByRounds();
  SolverOutcome SolveOneRound(int round_number);
  bool IsSettled();
  bool Report(int iteration,
              double cost,
              double step_sigmas,
              const Eigen::VectorXd& d) const;
  bool Cancel();
  bool Fail(const std::string& message);
  bool FailUndetermined();

  const CalibrateOptions& options_;
  Calibration theta_start_;
  const ProgressCallback& progress_;
  WorkingPoint* point_;
  DescentState state_;
};

}  // namespace selfcal
