// The log of what happened to rigs.
#pragma once

#include <cstdint>
#include <string>

namespace selfcal::server {

// As they lie in the database, from 1: only ever extended.
enum class EventKind {
  kRigCreated,
  kRunStarted,
  kRunEnded,
  kCalibrationPublished,
  kCalibrationRejected,
  kSegmentUnusable,
  kChangeDetected,
  kDataEvicted,            // a quota was reached
  kCalibrationActivated,   // by hand
  kCalibrationRolledBack,  // by hand
  kRunHeldBack,
  kSegmentQuarantined,  // by a run, neighbours, or by hand
  kCoresDisagree,       // a verification found a difference
  kRigUpdated,          // by hand, as the next two
  kRigDeleted,
  kSegmentDeleted,
};

struct StoredEvent {
  std::int64_t event = 0;  // counts from 1
  std::int64_t time_ns = 0;
  std::string rig;
  EventKind kind = EventKind::kRigCreated;
  std::string detail;
};

}  // namespace selfcal::server
