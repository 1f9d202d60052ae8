// The observations of a segment in the two orders that a score needs: by
// keyframe and camera, for their evaluation, and by landmark, for the
// elimination. A workspace: sorting the next segment reuses the memory.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/factor/keyframe_motion.h"
#include "core/factor/reprojection_batch.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

class ObservationOrder {
 public:
  void Find(const MotionSegment& segment, int cameras);

  // Indices into segment.observations, sorted by (landmark, keyframe, camera).
  std::span<const int> ByLandmark() const { return by_landmark_; }
  // Part of ByLandmark() that belongs to one landmark.
  std::span<const int> Track(int landmark) const {
    return ByLandmark().subspan(
        track_begin_[landmark],
        track_begin_[landmark + 1] - track_begin_[landmark]);
  }
  // Sorted by (keyframe, camera).
  std::span<const int> ByView() const { return by_view_; }

 private:
  std::vector<int> by_landmark_, track_begin_;
  std::vector<int> by_view_, begin_;
};

// A subset of the observations, by view, in the form that the kernels need.
class ObservationRuns {
 public:
  // Selects those with keep(index into segment.observations), in the given
  // order.
  template <typename Keep>
  void Select(const MotionSegment& segment,
              std::span<const int> by_view,
              const Keep& keep) {
    runs_.clear();
    indices_.clear();
    landmarks_.clear();
    z_px_.clear();
    for (const int index : by_view) {
      if (!keep(index)) continue;
      const Observation& o = segment.observations[index];
      if (runs_.empty() || runs_.back().keyframe != o.keyframe ||
          runs_.back().camera != o.camera) {
        const int begin = static_cast<int>(indices_.size());
        runs_.push_back({o.keyframe, o.camera, begin, begin});
      }
      ++runs_.back().end;
      indices_.push_back(index);
      landmarks_.push_back(o.landmark);
      z_px_.push_back(o.z_px.x());
      z_px_.push_back(o.z_px.y());
    }
  }

  struct Run {
    int keyframe;
    int camera;
    int begin;  // index among the selected ones
    int end;
  };
  std::span<const Run> runs() const { return runs_; }
  // Indices of the selected ones into segment.observations.
  std::span<const int> indices() const { return indices_; }

  ObservationRun Arrays(const Run& run,
                        const MotionSegment& segment,
                        const Calibration& theta,
                        const KeyframeMotions& motions) const {
    return {&segment.keyframes[run.keyframe],
            &theta.cameras[run.camera],
            run.end - run.begin,
            landmarks_.data() + run.begin,
            z_px_.data() + 2 * run.begin,
            motions.At(run.keyframe, run.camera)};
  }

 private:
  std::vector<Run> runs_;
  std::vector<int> indices_;
  std::vector<std::int32_t> landmarks_;
  std::vector<double> z_px_;
};

}  // namespace selfcal
