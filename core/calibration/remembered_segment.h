// Segments of a device in addition to those whose data a calibration has, and
// their use by the calibration (remembered_fusion.h). Values.
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

// A segment of a device; a calibration may or may not have its data.
struct RememberedSegment {
  SegmentKey key;
  // Its information; nullopt for a segment with data.
  std::optional<SegmentEnds> ends = std::nullopt;
  // ResidualStatistics::fit of a segment without data; 0: not measured.
  double fit = 0;
  // Time of reception, for the walk between sessions.
  std::int64_t time_ns = 0;
};

// A device split: the segments from `first` on have another theta than those
// before.
struct DeviceSplit {
  // Probability of the difference by chance, corrected for the number of tested
  // splits and parameters; 1: none was tested.
  double probability = 1;
  // The same at this split, with one segment excluded: the largest over all
  // choices.
  double without_one = 1;
  ChangeKind kind = ChangeKind::kSudden;
  // Number of segments from `first` on; for a drift, those that are near the
  // present state of the device.
  int newer = 0;
  SegmentKey first;                    // the oldest of these
  std::string block;                   // parameters that differ (theta_parts.h)
  std::vector<std::string> concerned;  // groups, in the order of the rig
};

// Contribution of segments without data to a result.
struct RememberedUse {
  int segments = 0;  // that contribute, besides those with data
  // Excluded segments: those that contradict the segments with data and, if
  // others are used, those that were linearised too far from the result.
  int too_far = 0;
  int contradicting = 0;
  // Segments that were tested against those with data, contradicting ones
  // included.
  int compared = 0;
  // Largest distance from the linearisation point of a used one to the result,
  // rms over the free components in reference sigmas.
  double reach = 0;
  // Agreement of all used ones together with the segments with data. If the
  // difference is larger than chance explains (5 %), their information is
  // reduced accordingly.
  AgreementTest agreement;
  // Reason why none was used; empty if some were, or there were none.
  std::string unused;
  // Set if the segments, with and without data, differ by more than chance
  // explains (5 %).
  std::optional<DeviceSplit> split = std::nullopt;
  // Posterior probability that the device changed while they were recorded; 0
  // if that was not examined. The covariance of the result accounts for it: for
  // each component (D), the variance is larger by the square of this than
  // without a change.
  double change_probability = 0;
  Eigen::VectorXd change_sigmas = {};
  // The one that was received last of those that do not contradict.
  SegmentKey newest = {};
};

}  // namespace selfcal
