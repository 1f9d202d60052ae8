// Reprojections of a linear system, view by view: their weights and their
// linearised rows. A workspace for one view at a time.
#pragma once

#include <cstdint>
#include <vector>

#include "core/calibration/linear_observations.h"
#include "core/calibration/linear_point.h"
#include "core/calibration/robust_loss.h"
#include "core/elimination/chain_elimination.h"
#include "core/factor/reprojection_batch.h"

namespace selfcal {

class LinearViews {
 public:
  explicit LinearViews(VectorWidth width) : reprojection_(width) {}

  // Sets weight and square of each observation. With a loss, residuals are
  // weighted as in iteratively reweighted least squares; null: all have full
  // weight. An observation that does not project, or that the loss gives almost
  // no weight, keeps a weight of zero.
  void Weigh(const LinearPoint& point,
             const RobustLoss* loss,
             LinearObservations* observations);

  // Adds the observations of one keyframe that have a factor to the elimination
  // of its chain, which begins at the keyframe `chain_begin`.
  void AddKeyframe(const LinearPoint& point,
                   const LinearObservations& observations,
                   int keyframe,
                   int chain_begin,
                   ChainElimination* elimination);

 private:
  // Gathers the observations of a view that `keep` selects, as arrays.
  template <typename Keep>
  ObservationRun Gather(const LinearPoint& point,
                        const LinearObservations& observations,
                        int view,
                        const Keep& keep);

  ReprojectionBatch reprojection_;
  std::vector<int> gathered_;  // indices into the observations
  std::vector<std::int32_t> landmarks_;
  std::vector<double> z_px_, squares_px2_, weights_, rows_;
  std::vector<int> factors_;
};

}  // namespace selfcal
