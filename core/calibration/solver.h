// One round of a calibration: the minimum over theta, keyframes and landmarks
// of a fixed set of landmarks and observations, with fixed whitening and fixed
// motions about the keyframes. Two solvers find the same minimum:
// structured_solver.h, and Ceres.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/calibration/screening.h"
#include "core/factor/inertial.h"
#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

struct SolverRound {
  const Rig& rig;
  const Calibration& reference;  // theta = reference [+] d
  const CalibrationProblem& problem;
  const KeyframeMotions& motions;  // at the initial estimate of the round
  const std::vector<InertialMatrix>& whitening;
  // D x r: the directions in which d may move (SubspaceManifold).
  const Eigen::MatrixXd& basis;
  RobustLoss loss;  // on reprojection residuals
  // Prior information about theta, centred at d = 0, D x D; null: no prior.
  const Eigen::MatrixXd* prior_information = nullptr;
  int threads = 1;  // of Ceres
  int max_iterations = 100;
  // Converged when an iteration reduces the cost by less than this fraction.
  double function_tolerance = 1e-9;
};

enum class SolverStatus { kConverged, kNotConverged, kCancelled, kFailed };

struct SolverOutcome {
  SolverStatus status = SolverStatus::kFailed;
  std::string message;  // the reason, if it failed
  int iterations = 0;
  double initial_cost = 0;
  double final_cost = 0;
};

// Reply of the caller after an iteration.
enum class SolverSignal {
  kGoOn,
  kEnough,  // ends the round as converged
  kCancel,
};

// Called after each iteration with its number, the cost, and the current d.
using SolverCallback = std::function<SolverSignal(
    int iteration, double cost, const Eigen::VectorXd& d)>;

// Ends a round once an iteration reduces the cost by less than `least` [half
// squares].
SolverCallback EndBelow(double least);

// Improves the estimate and the positions of the landmarks. If it fails or is
// cancelled, both are those of the last accepted step.
SolverOutcome SolveRound(SolverKind kind,
                         const SolverRound& round,
                         const SolverCallback& callback,
                         CalibrationEstimate* estimate,
                         std::vector<ScreenedLandmark>* landmarks);

}  // namespace selfcal
