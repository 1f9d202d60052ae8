#include "core/calibration/estimated_directions.h"

namespace selfcal {

ThetaSubspace EstimatedDirections::Choose(const Rig& rig,
                                          const Eigen::MatrixXd& Lambda) {
  const auto held = static_cast<int>(subspace_.held.cols());
  const int least_held = std::exchange(reweighted_, false) ? 0 : held;
  return assessed_
             ? HoldDirections(rig, Lambda, subspace_.held)
             : ObservedSubspace(rig, Lambda, least_held, kWeakInformation);
}

}  // namespace selfcal
