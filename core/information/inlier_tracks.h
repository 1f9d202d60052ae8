// The inliers of a segment in the two orders in which they are linearised and
// eliminated: by view and by landmark.
//
// A workspace for one thread: it allocates nothing after the largest segment.
#pragma once

#include <span>
#include <vector>

#include "core/information/inliers.h"
#include "core/information/observation_order.h"
#include "core/model/segment.h"

namespace selfcal {

class InlierTracks {
 public:
  // Replaces the tracks by those of a selection.
  void Find(const MotionSegment& segment,
            const InlierSelection& selection,
            const ObservationOrder& order);

  // Homogeneous p_G of the landmarks, 4 each.
  const double* points() const { return points_.data(); }
  // Begin of the inliers of each landmark, and the end of the last one; and
  // the keyframe of each inlier (ChainShape).
  std::span<const int> tracks() const { return tracks_; }
  std::span<const int> keyframes() const { return keyframes_; }
  // Runs by view, with the index by landmark of each inlier.
  const ObservationRuns& runs() const { return runs_; }
  std::span<const int> FactorsOf(const ObservationRuns::Run& run) const {
    return std::span<const int>(factors_).subspan(run.begin,
                                                  run.end - run.begin);
  }

 private:
  std::vector<double> points_;
  std::vector<int> tracks_, keyframes_;
  std::vector<int> factor_of_observation_;  // -1 for an outlier
  ObservationRuns runs_;
  std::vector<int> factors_;
};

}  // namespace selfcal
