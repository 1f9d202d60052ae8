// The estimate of a calibration at work, and what follows from it alone: the
// landmarks and observations that are used, their weights, the directions that
// are estimated, and the linearisation. The phases of a calibration
// (calibration_run.h) read it and move it.
#pragma once

#include <Eigen/Core>

#include "core/calibration/calibrate.h"
#include "core/calibration/estimated_directions.h"
#include "core/calibration/problem.h"
#include "core/calibration/round_selection.h"
#include "core/calibration/screening.h"
#include "core/calibration/solver.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

class WorkingPoint {
 public:
  // At the start: selects observations, and estimates all directions. The
  // options must outlive it.
  WorkingPoint(const Rig& rig,
               const Calibration& theta_start,
               CalibrationProblem problem,
               const CalibrateOptions& options);

  const Rig& rig() const { return rig_; }  // with the noise of the weights
  const CalibrationProblem& problem() const { return problem_; }
  const Calibration& reference() const { return reference_; }
  Calibration theta() const { return BoxPlus(reference_, estimate_.d); }
  const CalibrationEstimate& estimate() const { return estimate_; }
  const ThetaSubspace& subspace() const { return directions_.subspace(); }
  const Screening& screening() const { return selection_.screening(); }
  double track_noise_factor() const { return selection_.track_noise_factor(); }
  LinearisedRound& linearised() { return linearised_; }
  const LinearisedRound& linearised() const { return linearised_; }
  // Information about the offset d, prior included, and covariance of d.
  const SharedInformation& information() const { return linearised_.by_offset; }
  const Eigen::MatrixXd& covariance() const { return covariance_; }

  // The problem of a round at this point; `basis` as of TangentBasis.
  SolverRound Round(const Eigen::MatrixXd& basis) const;
  // The same with the loss of the options, which suits residuals of the noise
  // by which it is weighted.
  SolverRound RoundOfNoise(const Eigen::MatrixXd& basis) const;
  ReprojectionStatistics MeasureReprojections() const;
  // The cost without the weights for correlated tracks, which observations have
  // no longer from then on.
  double UnweightedCost();
  // Largest component of the undamped step of theta, in sigmas.
  double StepSigmas() const;

  // The functions that linearise return false if the states of the keyframes
  // are not determined.

  // Finds the directions that the data observes at the start, and linearises.
  bool FindSubspace();
  // Repeats the selection of everything that a round is based on; afresh:
  // regardless of the present selection.
  void Select();
  void SelectAfresh();
  bool Linearise();
  // Holds directions that the data does not observe at their start value.
  // Returns true if the size of the estimated subspace did not change.
  bool ChooseSubspace();
  // Select, Linearise and ChooseSubspace. As holding a direction moves the
  // estimate, this is repeated until the subspace is unchanged.
  bool RepeatSelection();
  // Holds the directions that an assessment of all of them found; from then on
  // no weakly observed direction is held for being weak. Selects and
  // linearises.
  bool HoldAssessed(ThetaSubspace subspace);

  // Weights by the noise of another rig, with the loss of the options at
  // `residuals` times the noise of its pixels: the noise that residuals show,
  // if that is less. The correlation along tracks is to be measured again.
  void WeightByNoise(const Rig& rig, double residuals);
  void WeightByTracks(double track_noise_factor);

  StepOutcome Step();  // from the linearisation
  SolverOutcome SolveRound(int max_iterations,
                           double tolerance,
                           const SolverCallback& callback);

 private:
  void SelectAtEstimate(bool afresh);
  bool LineariseBy(const RobustLoss* loss);
  void Hold(ThetaSubspace subspace);

  Rig rig_;
  CalibrationProblem problem_;
  const CalibrateOptions& options_;
  Calibration reference_;
  Eigen::VectorXd start_d_;
  CalibrationEstimate estimate_;
  EstimatedDirections directions_;
  RoundSelection selection_;
  LinearisedRound linearised_;
  Eigen::MatrixXd covariance_;
};

}  // namespace selfcal
