// Whether the cost of a calibration grows along a direction of theta as its
// linearisation has it.
//
// The information about a weak direction reaches as far as its sigma, and that
// may be further than the problem is linear: an accelerometer that is off by
// half, a lever arm of twice its length. The other directions then turn with
// this one, and what is claimed of them holds on a tangent, not where the truth
// is. Or it is there at one point only, where noise in states and landmarks
// looks like motion, and gone once they follow. Both show in the cost itself,
// with theta held a sigma away and all else at its minimum: it grows by more
// than the half that it should, or by less.
//
// Pure, any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/model/rig.h"

namespace selfcal {

// Half squares by which the growth of the cost may differ from what is claimed,
// a sigma from the minimum: the sigma then is what the cost shows to a fifth.
inline constexpr double kGrowthTolerance = 0.15;

class LinearRange {
 public:
  // About an estimate near its minimum. The round's basis has no columns: theta
  // is held. What the round refers to must outlive this.
  LinearRange(const SolverRound& round,
              const CalibrationEstimate& estimate,
              const std::vector<ScreenedLandmark>& landmarks);

  // Keyframes and landmarks came to a minimum. If not, nothing can be told.
  bool settled() const { return settled_; }

  // Of d at that minimum, the prior on theta included.
  const SharedInformation& information() const { return linearised_.by_offset; }

  // Whether the cost is as claimed one sigma to either side of where the
  // direction has its minimum by the linearisation. step: of d, not 0.
  bool Holds(const Eigen::VectorXd& step) const;

 private:
  bool GrowsAsClaimed(const Eigen::VectorXd& sigma_step, double length) const;

  const SolverRound round_;
  CalibrationEstimate estimate_;
  std::vector<ScreenedLandmark> landmarks_;
  LinearisedRound linearised_;
  bool settled_ = false;
};

// Holds what the data says less about than the prior, and of what it says less
// than weak_information about (in units of the prior) that for which the cost
// does not hold what is claimed. The range must be settled.
ThetaSubspace TrustedSubspace(const Rig& rig,
                              const LinearRange& range,
                              double weak_information);

}  // namespace selfcal
