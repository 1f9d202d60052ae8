// Segments of a device beside those that a calibration has the data of, and
// what it makes of them (evicted_fusion.h). Values.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/agreement.h"
#include "core/change/detect_change.h"
#include "core/information/segment_ends.h"
#include "core/model/segment.h"

namespace selfcal {

// A segment of a device, of which a calibration may have the data or not.
struct RememberedSegment {
  SegmentKey key;
  // What it says; nothing for one that has its data.
  std::optional<SegmentEnds> ends = std::nullopt;
  // ResidualStatistics::fit of one without data; 0: not measured.
  double fit = 0;
  // When it was received: for the walk between sessions.
  std::int64_t time_ns = 0;
};

// The segments from `first` on show another theta than those before.
struct DeviceSplit {
  // By chance, with the number of splits and parameters that were tried
  // accounted for; 1: none was tried.
  double probability = 1;
  // The same at this split, whichever single segment is left out: the largest.
  double without_one = 1;
  ChangeKind kind = ChangeKind::kSudden;
  // Segments from `first` on; of a drift, those that are near to what the
  // device is now.
  int newer = 0;
  SegmentKey first;   // the oldest of these
  std::string block;  // parameters that differ (parameter_blocks.h)
  std::vector<std::string> concerned;  // groups, in the order of the rig
};

// What a result has from segments without data.
struct EvictedUse {
  int segments = 0;  // that it stands on, besides those with data
  // Left out: contradicting what the segments with data say, or, where others
  // are used, linearised too far from the result.
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
  // Where the segments, with data and without, differ by more than chance
  // explains (5 %).
  std::optional<DeviceSplit> split = std::nullopt;
  // Posterior probability that the device changed while they were recorded; 0
  // if that was not examined. The covariance of the result accounts for it: by
  // component (D), its variance is the square of this larger than without a
  // change.
  double change_probability = 0;
  Eigen::VectorXd change_sigmas = {};
};

}  // namespace selfcal
