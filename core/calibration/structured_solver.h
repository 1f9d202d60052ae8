// A round of a calibration by Gauss-Newton on the structure of the problem.
//
// An iteration linearises all factors, eliminates landmarks and keyframes down
// to theta, chooses the step of theta, and back-substitutes for the step of the
// keyframes. Landmarks do not take the step of the linear system: at every
// trial point each is moved to its own minimum (variable projection), so that
// the parametrisation of a landmark does not matter. A line search on the true
// cost determines the length of the step. Deterministic.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/calibration/linear_system.h"
#include "core/calibration/solver.h"

namespace selfcal {

// A round, linearised at an estimate. The next one reuses its memory.
struct LinearisedRound {
  LinearSystem system;                   // of theta's tangent
  std::vector<InertialNoiseRoot> roots;  // of the inertial links
  Eigen::MatrixXd theta_by_offset;       // ThetaByOffset at the estimate
  SharedInformation by_offset;           // about d, prior on theta included
  double cost = 0;                       // RoundCost
};

// Cost that a round minimises: half of the sum of all losses and squares.
double RoundCost(const SolverRound& round,
                 const CalibrationEstimate& estimate,
                 const std::vector<ScreenedLandmark>& landmarks);

// Linearises a round. With a loss, observations are weighted by it; null: all
// have full weight. Returns false if the states of the keyframes are not
// determined. LineariseFactors does not compute the cost.
bool LineariseFactors(const SolverRound& round,
                      const CalibrationEstimate& estimate,
                      const std::vector<ScreenedLandmark>& landmarks,
                      const RobustLoss* loss,
                      LinearisedRound* result,
                      double damping = 0);
bool LineariseRound(const SolverRound& round,
                    const CalibrationEstimate& estimate,
                    const std::vector<ScreenedLandmark>& landmarks,
                    const RobustLoss* loss,
                    LinearisedRound* result,
                    double damping = 0);

struct StepOutcome {
  bool lower = false;  // else nothing was moved: no step decreases the cost
  double cost = 0;     // after it
};

// Takes one step from the estimate at which the round was linearised with its
// loss.
StepOutcome TakeStep(const SolverRound& round,
                     const LinearisedRound& linearised,
                     CalibrationEstimate* estimate,
                     std::vector<ScreenedLandmark>* landmarks);

// Moves d by a step, and all other unknowns by the back-substituted steps.
void ApplyStep(const LinearisedRound& linearised,
               const Eigen::VectorXd& step_d,
               CalibrationEstimate* estimate,
               std::vector<ScreenedLandmark>* landmarks);

// Implements SolveRound.
SolverOutcome SolveRoundByStructure(const SolverRound& round,
                                    const SolverCallback& callback,
                                    CalibrationEstimate* estimate,
                                    std::vector<ScreenedLandmark>* landmarks);

}  // namespace selfcal
