// A round of a calibration by Gauss-Newton on the structure of the problem.
//
// An iteration linearises all factors, eliminates landmarks and keyframes down
// to theta, chooses the step of theta, and goes back to the step of the
// keyframes. Landmarks do not take the step of the linear system: at every
// point that is tried, each is brought to its own minimum (variable
// projection), so that it does not matter how a landmark is parametrised. The
// length of the step follows from the true cost. Deterministic.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/calibration/linear_system.h"
#include "core/calibration/solver.h"

namespace selfcal {

// A round, linearised at an estimate. Its memory serves the next one.
struct LinearisedRound {
  LinearSystem system;                   // of theta's tangent
  std::vector<InertialNoiseRoot> roots;  // of the inertial links
  Eigen::MatrixXd theta_by_offset;       // ThetaByOffset at the estimate
  SharedInformation by_offset;           // of d, prior on theta included
  double cost = 0;                       // RoundCost
};

// What a round minimises: half of the sum of all losses and squares.
double RoundCost(const SolverRound& round,
                 const CalibrationEstimate& estimate,
                 const std::vector<ScreenedLandmark>& landmarks);

// With a loss, observations are weighted by it; null: all count fully. False if
// the states of the keyframes are not determined. LineariseFactors leaves the
// cost out.
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
  bool lower = false;  // else nothing was moved: no step lowers the cost
  double cost = 0;     // after it
};

// Goes one step from where the round was linearised with its loss.
StepOutcome TakeStep(const SolverRound& round,
                     const LinearisedRound& linearised,
                     CalibrationEstimate* estimate,
                     std::vector<ScreenedLandmark>* landmarks);

// Moves d by a step, and all else by what the linear system has for it.
void GoAlong(const LinearisedRound& linearised,
             const Eigen::VectorXd& step_d,
             CalibrationEstimate* estimate,
             std::vector<ScreenedLandmark>* landmarks);

// As SolveRound.
SolverOutcome SolveRoundByStructure(const SolverRound& round,
                                    const SolverCallback& callback,
                                    CalibrationEstimate* estimate,
                                    std::vector<ScreenedLandmark>* landmarks);

}  // namespace selfcal
