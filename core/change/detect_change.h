// Has the device changed? Sequential, over the newest segments.
//
// A course (course.h) is tried for each size that a change may have: a step
// before the newest n segments, or a ramp over them, of some n up to
// max_window; and for each, every part of theta that may have changed alone
// (parameter_blocks.h). Short courses find a shock, long ones a slow drift, of
// which each segment alone shows nothing. A change is detected where the
// evidence stands whichever one of the segments is left out: a single
// inconsistent segment is none; and where it stands with the noise by which
// the segments differ from each other, if that is larger than they claim.
//
// Rate of false alarms: each of these tests is chi-square distributed, its
// level the stated rate over the number of courses, times the share of its
// part of theta. Whatever they have in common, and
// the error of the active calibration with them, the probability of an alarm at
// one segment is thus at most the stated rate.
//
// Pure, deterministic, any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/change/consistency.h"
#include "core/change/group_concern.h"

namespace selfcal {

struct ChangeOptions {
  // Of the variances of segments, for who makes the tester (consistency.h).
  std::optional<double> inflation = std::nullopt;
  // Upper bound of the probability of a false alarm, for each new segment; 0:
  // nothing is ever detected.
  double false_alarm_rate = 1e-5;
  int max_window = 64;  // segments
  // A group is concerned where its test is less probable than this.
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
  int window = 0;        // segments of the course that found it
  std::string block;     // whose test found it
  ConsistencyTest test;  // its test
  // In the order of rig.groups, given the course that is most likely; those
  // concerned by name.
  std::vector<GroupConcern> groups;
  std::vector<std::string> concerned;  // never empty
};

// The newest segments in the order of their arrival, as OffsetInformation of
// `tester`; more than max_window are not looked at. They must not have entered
// the active calibration. Nothing: no change.
std::optional<Change> DetectChange(const ConsistencyTester& tester,
                                   const std::vector<OffsetInformation>& newest,
                                   const ChangeOptions& options = {});

}  // namespace selfcal
