#include "core/information/inlier_tracks.h"

#include <Eigen/Core>
#include <cstddef>

namespace selfcal {

void InlierTracks::Find(const MotionSegment& segment,
                        const InlierSelection& selection,
                        const ObservationOrder& order) {
  points_.resize(4 * selection.landmarks.size());
  for (std::size_t m = 0; m < selection.landmarks.size(); ++m) {
    Eigen::Vector4d::Map(&points_[4 * m]) =
        selection.landmarks[m].homogeneous();
  }
  tracks_.clear();
  keyframes_.clear();
  factor_of_observation_.assign(segment.observations.size(), -1);
  int landmark = -1;
  for (const int index : selection.inliers) {
    const Observation& o = segment.observations[index];
    const int factor = static_cast<int>(keyframes_.size());
    if (o.landmark != landmark) tracks_.push_back(factor);
    landmark = o.landmark;
    factor_of_observation_[index] = factor;
    keyframes_.push_back(o.keyframe);
  }
  tracks_.push_back(static_cast<int>(keyframes_.size()));
  runs_.Select(segment, order.ByView(), [&](int index) {
    return factor_of_observation_[index] >= 0;
  });
  factors_.clear();
  for (const int index : runs_.indices()) {
    factors_.push_back(factor_of_observation_[index]);
  }
}

}  // namespace selfcal
