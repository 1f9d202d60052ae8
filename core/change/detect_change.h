// Sequential detection of a device change over the newest segments.
//
// A course (course.h) is tested for each possible extent of a change: a step
// before the newest n segments, or a ramp over them, for several n up to
// max_window; and for each, every part of theta that may have changed alone
// (theta_parts.h). Short courses find a shock, long ones a slow drift that
// no single segment reveals. A change is detected only if the evidence holds
// with any one of the segments excluded: a single inconsistent segment is no
// change; and if it holds with the noise estimated from the differences among
// the segments, if that is larger than their information claims.
//
// Rate of false alarms: each of these tests is chi-square distributed; its
// level is the stated rate divided by the number of courses, times the share of
// its part of theta. Whatever correlation the tests have, including that due to
// the error of the active calibration, the probability of an alarm at one
// segment is thus at most the stated rate.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/change/consistency.h"
#include "core/change/group_concern.h"

namespace selfcal {

struct ChangeOptions {
  // Factor on the variances of segments, for the caller that makes the tester
  // (consistency.h).
  std::optional<double> inflation = std::nullopt;
  // Upper bound of the probability of a false alarm, for each new segment; 0:
  // detection is disabled.
  double false_alarm_rate = 1e-5;
  int max_window = 64;  // segments
  // A group is concerned if its test is less probable than this.
  double group_level = 0.01;
  // Probability that the change lies before the segments that are treated as
  // after it, given that there was one.
  double since_probability = 0.99;

  friend bool operator==(const ChangeOptions&, const ChangeOptions&) = default;
};

// The numbers are those on disk and never change.
enum class ChangeKind {
  kSudden = 1,  // one step
  kDrift = 2,   // grew over the window
};

struct Change {
  ChangeKind kind = ChangeKind::kSudden;
  // Number of newest segments that are entirely after the change. For a drift,
  // those that are nearest to the present state of the device.
  int segments_since = 0;
  int window = 0;        // segments of the course that found it
  std::string block;     // whose test detected it
  ConsistencyTest test;  // its test
  // Concern of each group, in the order of rig.groups, given the most likely
  // course; and the names of the concerned ones.
  std::vector<GroupConcern> groups;
  std::vector<std::string> concerned;  // never empty
};

// `newest` are the newest segments in the order of their arrival, as
// OffsetInformation of `tester`; only the last max_window are used. They must
// not be part of the active calibration. Returns nullopt if there is no change.
std::optional<Change> DetectChange(const ConsistencyTester& tester,
                                   const std::vector<OffsetInformation>& newest,
                                   const ChangeOptions& options = {});

}  // namespace selfcal
