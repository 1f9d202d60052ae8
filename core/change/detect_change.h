// Has the device changed? Sequential, over the newest segments.
//
// A window is the fused information of the newest n segments, n = 2, 4, 8, ...
// Short windows find a shock, long ones a slow drift, of which each segment
// alone shows nothing. A change is detected where the evidence of a window
// stands whichever one of its segments is left out: a single inconsistent
// segment is none.
//
// Rate of false alarms: each window's test is chi-square distributed, its level
// the stated rate over the number of windows. Whatever the windows have in
// common, and the error of the active calibration with them, the probability of
// an alarm at one segment is thus at most the stated rate.
//
// Pure, deterministic, any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/change/consistency.h"

namespace selfcal {

struct ChangeOptions {
  // Of the variances of segments, for who makes the tester (consistency.h).
  std::optional<double> inflation = std::nullopt;
  // Upper bound of the probability of a false alarm, for each new segment; 0:
  // nothing is ever detected.
  double false_alarm_rate = 1e-6;
  int max_window = 16;  // segments
  // A group whose own test is less probable than this is concerned.
  double group_level = 0.01;
  // The change lies before the segments that count as after it with this
  // probability, given that there was one.
  double since_probability = 0.99;

  friend bool operator==(const ChangeOptions&, const ChangeOptions&) = default;
};

enum class ChangeKind {
  kSudden,  // one step
  kDrift,   // grew over the window
};

struct Change {
  ChangeKind kind = ChangeKind::kSudden;
  // Newest segments that come wholly after the change. For a drift, those that
  // are nearest to what the device is now.
  int segments_since = 0;
  int window = 0;        // segments whose test found it
  ConsistencyTest test;  // of that window
  // In the order of rig.groups, over the segments that are most likely after
  // the change; those concerned by name.
  std::vector<GroupConsistency> groups;
  std::vector<std::string> concerned;  // never empty
};

// The newest segments in the order of their arrival, as OffsetInformation of
// `tester`; more than max_window are not looked at. They must not have entered
// the active calibration. Nothing: no change.
std::optional<Change> DetectChange(const ConsistencyTester& tester,
                                   const std::vector<OffsetInformation>& newest,
                                   const ChangeOptions& options = {});

}  // namespace selfcal
