// State and trigger of a run; filter and order of a list of runs.
#pragma once

#include <cstdint>
#include <optional>

#include "server/store/range.h"

namespace selfcal::server {

// The numbers are those on disk and never change.
enum class RunState {
  kPending = 1,
  kRunning = 2,
  kSucceeded = 3,
  kFailed = 4,
  kCancelled = 5,
};

// The reason why a run was created. The numbers are those of
// selfcal.v1.Recalibration.Trigger and never change.
enum class RunTrigger {
  kTablesFull = 1,
  kTablesChanged = 2,
  kManual = 3,
  kChangeDetected = 4,  // the tables are full for the first time since one
  kCalibrationAged = 5,
  kSessionEnded = 6,  // and a run is due (server/domain/session_trigger.h)
};

// A run that has not ended has no duration and is in no list sorted by it.
struct RunQuery {
  std::optional<RunState> state;
  std::optional<RunTrigger> trigger;
  Range<std::int64_t> create_time_ns;  // since the Unix epoch

  enum class Order { kCreation, kDuration };
  Order order = Order::kCreation;
  bool descending = true;

  friend bool operator==(const RunQuery&, const RunQuery&) = default;
};

}  // namespace selfcal::server
