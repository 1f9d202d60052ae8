// The directions of theta that a calibration estimates, as its rounds choose
// them from the information of the data.
#pragma once

#include <Eigen/Core>
#include <utility>

#include "core/calibration/subspace.h"
#include "core/model/rig.h"

namespace selfcal {

// Threshold in units of the prior. Directions with less information from the
// data are held constant until all others are estimated: from a poor start, the
// estimate would move along them out of the range of the linearisation.
inline constexpr double kWeakInformation = 100;

class EstimatedDirections {
 public:
  // All of them, at first.
  explicit EstimatedDirections(const Rig& rig)
      : subspace_(WholeSubspace(rig)) {}

  const ThetaSubspace& subspace() const { return subspace_; }
  void Set(ThetaSubspace subspace) { subspace_ = std::move(subspace); }

  // The directions that are held were found by an assessment of all: from then
  // on none is held for being weak.
  void SetAssessed() { assessed_ = true; }
  // The next choice may release directions: with the new weights of the data
  // they may be observed.
  void SetReweighted() { reweighted_ = true; }

  // Chooses by Lambda (of the data, in tangent units), without setting it.
  ThetaSubspace Choose(const Rig& rig, const Eigen::MatrixXd& Lambda);

 private:
  ThetaSubspace subspace_;
  bool assessed_ = false;
  bool reweighted_ = false;  // since the last choice
};

}  // namespace selfcal
