// A whole calibration problem, linearised at one estimate and eliminated down
// to theta, with the back-substitution from a step of theta to the steps of all
// other unknowns. Deterministic.
//
// Only recalibrations use it; a score uses SegmentLineariser
// (core/information). Lambda is D x D and eta has D entries, in the tangent
// units of calibration.h; components that the rig holds fixed are not removed.
//
// Keyframes that are connected by IMU samples form a chain, eliminated by
// ChainElimination. The unknowns that connect chains are kept: landmarks that
// several of them observe and, for each gap over which biases walk, the biases
// in the middle of the walk, to which each end is tied with half of the
// variance. Together with theta these form a small dense system, the interface.
// A landmark whose track has distant pieces in one chain is kept as well, since
// otherwise all keyframes between two pieces would be in the front.
//
// The system minimises
//   F(d) = sum |r + J d|^2 over all factors + the priors
// over the steps d of the keyframes (15 each), of the landmarks and of theta's
// tangent. It has no prior on theta: the caller adds one to Lambda, chooses the
// step, within a subspace or shortened, and requests the other steps.
//
// The phases of Linearise: observations are collected and weighted
// (LinearObservations, LinearViews); the elimination is planned
// (EliminationPlan); inertial factors are linearised (LinearMotion) and priors
// set (KeyframePriors); the reprojections of each chain are linearised
// (LinearViews), and it is eliminated down to the interface, the unknowns that
// chains share (LinearInterface); the priors of kept landmarks are added; the
// interface is eliminated.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/calibration/linear_chains.h"
#include "core/calibration/linear_interface.h"
#include "core/calibration/linear_motion.h"
#include "core/calibration/linear_observations.h"
#include "core/calibration/linear_point.h"
#include "core/calibration/linear_posterior.h"
#include "core/calibration/linear_views.h"
#include "core/calibration/robust_loss.h"
#include "core/elimination/chain_elimination.h"
#include "core/factor/inertial_batch.h"

namespace selfcal {

class LinearSystem {
 public:
  explicit LinearSystem(VectorWidth width = WidestVectors())
      : width_(width), views_(width), motion_(width) {}

  // Linearises and whitens all factors and the gauge at the point, and
  // eliminates; `roots` are the noise of its inertial links. With a loss,
  // residuals are weighted as in iteratively reweighted least squares: for the
  // Huber loss on normal residuals, the inverse of Lambda is then the
  // covariance of the estimate to 1 %. Without a loss (null), all have full
  // weight. The weak priors of the score keep undetermined states proper; since
  // they are centred at the estimate, they do not move it. Damping strengthens
  // these priors to the size of small steps; it is for computing a step, not
  // the information about theta. A damping of 1 is negligible for states that
  // are determined. Landmarks with fewer than two remaining observations are
  // excluded. The previous linearisation is discarded, its memory is reused;
  // nothing of the point is kept.
  void Linearise(const LinearPoint& point,
                 std::span<const InertialNoiseRoot> roots,
                 const RobustLoss* loss,
                 double damping = 0);

  // Information about theta's tangent. Not finite if the factors are not.
  const SharedInformation& information() const { return information_; }

  // Frees the memory that steps and posterior need: until the next
  // linearisation only information and decrease remain.
  void ReleaseMemory();

  // Decrease of F by the optimal steps of keyframes and landmarks with theta
  // held constant; with a step s of theta, F decreases by
  //   decrease + 2 eta^T s - s^T Lambda s.
  double decrease() const { return decrease_; }

  // Back-substitution: the steps that minimise F for a step of theta, of the
  // keyframes (chain_unknowns.h) and of the landmarks by (alpha, beta, rho) of
  // landmark_position.h; zero for excluded landmarks.
  void FindSteps(const Eigen::VectorXd& theta_step,
                 std::vector<ChainStateVector>* keyframes,
                 std::vector<Eigen::Vector3d>* landmarks) const;

  // Posterior for a step of theta with the given covariance. `landmarks` as
  // they were linearised.
  LinearPosterior FindPosterior(
      const Eigen::VectorXd& theta_step,
      const Eigen::MatrixXd& theta_covariance,
      const std::vector<ScreenedLandmark>& landmarks) const;

 private:
  void EliminateChain(const LinearPoint& point,
                      const ChainPlan& plan,
                      ChainElimination* elimination,
                      SharedInformation* result);
  // Derivative of the theta_s of a chain by theta; null: the identity.
  const Eigen::MatrixXd* DerivativeOf(const ChainPlan& plan) const;
  // Step of the unknowns that a chain shares with others.
  Eigen::VectorXd SharedStep(const ChainPlan& plan,
                             const Eigen::VectorXd& theta_step,
                             const Eigen::VectorXd& interface_step) const;

  VectorWidth width_;
  LinearObservations observations_;
  LinearViews views_;
  LinearMotion motion_;
  KeyframePriors priors_;
  EliminationPlan plan_;
  // Derivatives of theta_s by theta; empty: the identity.
  std::vector<Eigen::MatrixXd> derivatives_;
  std::vector<ChainElimination> chains_;  // of the plan
  LinearInterface interface_;
  SharedInformation information_;
  double decrease_ = 0;
};

}  // namespace selfcal
