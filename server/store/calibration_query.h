// State and verdict of a version; filter and order of a list of versions.
#pragma once

#include <cstdint>
#include <optional>

#include "server/store/range.h"

namespace selfcal::server {

// The numbers are those on disk and never change. The transitions between the
// states are in server/domain/calibration_life.h.
enum class CalibrationState {
  kActive = 1,
  kSuperseded = 2,
  kRejected = 3,
  kCandidate = 4,
  kRolledBack = 5,
};

// The numbers are those on disk and never change.
enum class VerdictKind {
  kUnknown = 0,  // not validated yet, or stored before there were verdicts
  kGood = 1,
  kWeak = 2,
  kNotTrustworthy = 3,
  kFactory = 4,
};

// A version whose segments state no temperature is in no range of temperatures
// and in no list sorted by them.
struct CalibrationQuery {
  std::optional<CalibrationState> state;
  std::optional<VerdictKind> verdict;  // as it is shown (VerdictOf)
  Range<std::int64_t> create_time_ns;  // since the Unix epoch
  Range<double> temperature_c;         // SegmentTemperatures::mean_c

  enum class Order { kCreation, kTemperature };
  Order order = Order::kCreation;
  bool descending = true;

  friend bool operator==(const CalibrationQuery&,
                         const CalibrationQuery&) = default;
};

// The parts of a version that a list has: all but the iterations of the solver,
// or only what a line of a list shows, also without covariances, settings and
// the fits of segments.
enum class CalibrationParts { kAll, kSummary };

}  // namespace selfcal::server
