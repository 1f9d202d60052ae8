// Do segments that one calibration is to come from show one and the same
// device, or one that changed among them?
//
// A mixture of segments from before and after a change gives a calibration that
// is neither, and that fits new segments half as badly as the one before: what
// gives it away is that its own segments differ, the older from the newer.
//
// Pure, deterministic, any thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/change/consistency.h"
#include "core/change/detect_change.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

struct SplitTest {
  int segments = 0;  // that could be tested; 0: nothing was tested
  // Of the step or ramp that explains most, with the smallest probability by
  // chance of any that is tried (their number is accounted for), whichever
  // segment is left out; 1: none stands out.
  double probability = 1;
  ConsistencyTest test;  // of that one alone
  ChangeKind kind = ChangeKind::kSudden;
  // Index of the first segment after the step, or with which the ramp begins.
  int first_after = 0;
  std::string block;  // parameters that differ (parameter_blocks.h)
};

// The information of the segments and their times, of one clock or such that
// later sessions have later times, ascending; as many of both. Nothing needs to
// be known of theta but that all of them are near the calibration `theta`:
// those that are not, or that are unusable (ConsistencyTester::Accepts), are
// left out. Variances of segments are taken times `inflation`, as for
// ConsistencyTester. At least two segments lie on either side of a step.
SplitTest TestSplit(const Rig& rig,
                    const Calibration& theta,
                    std::span<const SegmentInformation> segments,
                    std::span<const std::int64_t> times_ns,
                    double inflation = 1);

}  // namespace selfcal
