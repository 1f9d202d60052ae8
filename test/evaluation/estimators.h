// The estimators that the evaluation compares, on the same data with the same
// factors and solver: they differ in the segments that they calibrate on.
#pragma once

#include <cstdint>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Of all calibrations that are compared: what residuals say about the noise of
// the rig is another matter, and takes as long again.
inline CalibrateOptions ComparedOptions() {
  CalibrateOptions options;
  options.noise_scales = false;
  return options;
}

// What each segment says, scored at the factory's calibration, in their order.
std::vector<SegmentInformation> ScoreAll(
    const Rig& rig, const std::vector<MotionSegment>& segments);

// Segments of a dataset by their indices, ascending.
using SegmentSet = std::vector<int>;

// Those of core/selection/baselines.h, of segments offered in their order: what
// the tables of the rig hold in the end; the same with the highest entropies;
// one table over all of theta; and at random.
SegmentSet MostInformative(const Rig& rig,
                           const std::vector<SegmentInformation>& scores);
SegmentSet LeastInformative(const Rig& rig,
                            const std::vector<SegmentInformation>& scores);
SegmentSet SingleGroup(const Rig& rig,
                       int capacity,
                       const std::vector<SegmentInformation>& scores);
SegmentSet LeastOfSingleGroup(const Rig& rig,
                              int capacity,
                              const std::vector<SegmentInformation>& scores);
SegmentSet RandomSegments(const Rig& rig,
                          int size,
                          std::uint64_t seed,
                          const std::vector<SegmentInformation>& scores);
// All of them: batch.
SegmentSet AllSegments(int count);

std::vector<MotionSegment> Pick(const std::vector<MotionSegment>& segments,
                                const SegmentSet& set);

// Calibrates on the set from the factory's calibration. Throws
// std::runtime_error if the solver does not converge.
CalibrationResult CalibrateOn(
    const Rig& rig,
    const std::vector<MotionSegment>& segments,
    const SegmentSet& set,
    const CalibrateOptions& options = ComparedOptions());

}  // namespace selfcal
