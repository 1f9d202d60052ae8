// Segments of a device beside those that a calibration has the data of, and
// what it makes of them (evicted_fusion.h). Values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/calibration/agreement_test.h"
#include "core/information/segment_ends.h"
#include "core/model/segment.h"

namespace selfcal {

// A segment of a device, of which a calibration may have the data or not.
struct RememberedSegment {
  SegmentKey key;
  // What it says; nothing for one that has its data.
  std::optional<SegmentEnds> ends = std::nullopt;
  double fit = 0;  // ResidualStatistics::fit; 0: not measured
  // When it was recorded, by a clock that all sessions share.
  std::int64_t time_ns = 0;
};

// What a result has from segments without data.
struct EvictedUse {
  int segments = 0;  // that it stands on, besides those with data
  // Not used: linearised too far from the result, or contradicting what the
  // segments with data say.
  int too_far = 0;
  int contradicting = 0;
  // The largest distance from where a used one was linearised to the result,
  // rms over the free components in reference sigmas.
  double reach = 0;
  // Of all used ones together with the segments with data. Where it is more
  // than chance explains (5 %), what they say was taken for as much less.
  AgreementTest agreement;
  // Why none was used; empty where some were, or there were none.
  std::string unused;
};

}  // namespace selfcal
