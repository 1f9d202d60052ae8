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

// What each segment says, scored at the factory's calibration, in their order.
std::vector<SegmentInformation> ScoreAll(
    const Rig& rig, const std::vector<MotionSegment>& segments);

// Segments of a dataset by their indices, ascending.
using SegmentSet = std::vector<int>;

// The segments that the tables of the rig hold in the end: for each group those
// of lowest entropy.
SegmentSet MostInformative(const Rig& rig,
                           const std::vector<SegmentInformation>& scores);
// The same tables with the segments of highest entropy, whatever they gain.
SegmentSet LeastInformative(const Rig& rig,
                            const std::vector<SegmentInformation>& scores);
// One table of so many segments over all of theta.
SegmentSet SingleGroup(const Rig& rig,
                       int capacity,
                       const std::vector<SegmentInformation>& scores);
SegmentSet LeastOfSingleGroup(const Rig& rig,
                              int capacity,
                              const std::vector<SegmentInformation>& scores);
// Of `count` segments, `size` at random. For one seed the sets of growing
// counts differ by one replacement at most, as a table's do.
SegmentSet RandomSegments(int count, int size, std::uint64_t seed);
// All of them: batch.
SegmentSet AllSegments(int count);

std::vector<MotionSegment> Pick(const std::vector<MotionSegment>& segments,
                                const SegmentSet& set);

// Calibrates on the set from the factory's calibration. Throws
// std::runtime_error if the solver does not converge.
CalibrationResult CalibrateOn(const Rig& rig,
                              const std::vector<MotionSegment>& segments,
                              const SegmentSet& set,
                              const CalibrateOptions& options = {});

}  // namespace selfcal
