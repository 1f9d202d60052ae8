// Tests whether the cost of a calibration grows along a direction of theta as
// predicted by its linearisation.
//
// The information about a weak direction applies up to about its sigma, which
// may be further than the problem is linear: an accelerometer with a scale
// error of a half, a lever arm of twice its length. The other directions then
// rotate with this one, and their claimed covariance holds on a tangent that
// does not contain the truth. Or the information exists at one point only,
// where noise in states and landmarks looks like motion, and vanishes once they
// adapt. Both are visible in the cost itself, with theta held one sigma away
// and everything else at its minimum: it grows by more than the expected half,
// or by less.
//
// Pure, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/model/rig.h"

namespace selfcal {

// Tolerance of the growth of the cost [half squares], one sigma from the
// minimum: the sigma then agrees with the cost to one fifth.
inline constexpr double kGrowthTolerance = 0.15;

// Iterations of keyframes and landmarks, from where a calibration ended.
inline constexpr int kRangeIterations = 10;

class LinearRange {
 public:
  // Tests about an estimate near its minimum. The round's basis has no columns:
  // theta is held constant. The objects that the round refers to must outlive
  // this. A minimum that takes more than `max_iterations` is not reached.
  LinearRange(const SolverRound& round,
              const CalibrationEstimate& estimate,
              const std::vector<ScreenedLandmark>& landmarks,
              int max_iterations = kRangeIterations);

  // True if keyframes and landmarks reached a minimum. If not, nothing can be
  // tested.
  bool settled() const { return settled_; }

  // Information about d at that minimum, including the prior on theta.
  const SharedInformation& information() const { return linearised_.by_offset; }

  // Returns true if the cost is as claimed one sigma to either side of the
  // minimum of the direction according to the linearisation. step: of d, not 0.
  bool Holds(const Eigen::VectorXd& step) const;

 private:
  bool GrowsAsClaimed(const Eigen::VectorXd& sigma_step, double length) const;

  const SolverRound round_;
  CalibrationEstimate estimate_;
  std::vector<ScreenedLandmark> landmarks_;
  LinearisedRound linearised_;
  bool settled_ = false;
};

// Holds constant the directions with less information from the data than from
// the prior and, among those with less than weak_information (in units of the
// prior), the ones for which the cost does not confirm the claimed information.
// The range must be settled.
ThetaSubspace TrustedSubspace(const Rig& rig,
                              const LinearRange& range,
                              double weak_information);

}  // namespace selfcal
