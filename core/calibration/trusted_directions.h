// Decides, at a minimum, along which weakly observed directions of theta its
// information can be trusted.
#pragma once

#include <optional>
#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/subspace.h"
#include "core/calibration/working_point.h"
#include "core/model/segment.h"

namespace selfcal {

// The subspace in which weakly observed directions, all of which are held so
// far, are estimated if their linearisation holds within their sigma
// (linear_range.h). Nothing if none is held, or if that cannot be tested.
std::optional<ThetaSubspace> ReleaseWeakDirections(const WorkingPoint& point);

struct SpuriousTest {
  // False if no replica with added noise reaches a minimum: nothing can be said
  // about the estimated directions.
  bool made = true;
  // The subspace that also holds the spurious directions; nullopt if there are
  // none.
  std::optional<ThetaSubspace> remaining = std::nullopt;
};

// Finds the directions whose information stems from noise in the states
// (noise_replica.h). `segments` and `partitioning` are those of the problem.
// The linear system of `point` loses its memory.
SpuriousTest HoldSpuriousDirections(
    const std::vector<const MotionSegment*>& segments,
    const Partitioning& partitioning,
    WorkingPoint* point);

}  // namespace selfcal
