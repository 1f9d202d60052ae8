#include "core/calibration/linear_views.h"

#include <algorithm>
#include <cmath>

namespace selfcal {
namespace {

// An observation with less weight is treated as beyond the gate: a landmark
// must not depend on observations with almost no weight.
constexpr double kLeastWeight = 1e-6;

}  // namespace

template <typename Keep>
ObservationRun LinearViews::Gather(const LinearPoint& point,
                                   const LinearObservations& observations,
                                   int view,
                                   const Keep& keep) {
  gathered_.clear();
  landmarks_.clear();
  z_px_.clear();
  for (const int i : observations.OfView(view)) {
    const LinearObservation& seen = observations[i];
    if (!keep(seen)) continue;
    gathered_.push_back(i);
    landmarks_.push_back(seen.landmark);
    z_px_.push_back(seen.z_px.x());
    z_px_.push_back(seen.z_px.y());
  }
  const int keyframe = view / observations.cameras();
  const int camera = view % observations.cameras();
  return {&point.keyframes[keyframe],
          &point.thetas.OfKeyframe(keyframe).cameras[camera],
          static_cast<int>(gathered_.size()),
          landmarks_.data(),
          z_px_.data(),
          point.motions.At(keyframe, camera)};
}

void LinearViews::Weigh(const LinearPoint& point,
                        const RobustLoss* loss,
                        LinearObservations* observations) {
  const double inverse_sigma = 1 / point.rig.pixel_sigma_px;
  for (int view = 0; view < observations->views(); ++view) {
    const ObservationRun run =
        Gather(point, *observations, view, [](const LinearObservation&) {
          return true;
        });
    squares_px2_.resize(std::max<std::size_t>(squares_px2_.size(), run.count));
    reprojection_.Squares(run, observations->points(), squares_px2_.data());
    for (int i = 0; i < run.count; ++i) {
      LinearObservation& seen = (*observations)[gathered_[i]];
      const double s = squares_px2_[i] * inverse_sigma * inverse_sigma;
      if (!(s >= 0)) continue;  // does not project
      const double weight = loss != nullptr ? loss->Weight(s) : 1;
      if (weight < kLeastWeight) continue;
      seen.weight = std::sqrt(seen.share * weight) * inverse_sigma;
      seen.square = seen.share * weight * s;
    }
  }
}

void LinearViews::AddKeyframe(const LinearPoint& point,
                              const LinearObservations& observations,
                              int keyframe,
                              int chain_begin,
                              ChainElimination* elimination) {
  for (int camera = 0; camera < observations.cameras(); ++camera) {
    const ObservationRun run =
        Gather(point,
               observations,
               keyframe * observations.cameras() + camera,
               [](const LinearObservation& seen) { return seen.factor >= 0; });
    if (run.count == 0) continue;
    weights_.clear();
    factors_.clear();
    for (const int i : gathered_) {
      weights_.push_back(observations[i].weight);
      factors_.push_back(observations[i].factor);
    }
    const std::size_t size = static_cast<std::size_t>(2) *
                             (run.count + kPanelPad) *
                             RowsOf(*run.camera).stride();
    if (rows_.size() < size) rows_.resize(size);
    reprojection_.Linearise(run,
                            observations.points(),
                            point.rig.pixel_sigma_px,
                            weights_.data(),
                            rows_.data());
    const auto turn = PoseTurn(run);
    elimination->AddObservations(keyframe - chain_begin,
                                 camera,
                                 rows_.data(),
                                 factors_,
                                 turn ? &*turn : nullptr);
  }
}

}  // namespace selfcal
