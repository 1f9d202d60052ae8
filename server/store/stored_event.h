// Events: the log of what happened to rigs and to the daemon.
#pragma once

#include <cstdint>
#include <string>

namespace selfcal::server {

// Their positions, counted from 1, are stored in the database: only ever
// extended.
enum class EventKind {
  kRigCreated,
  kRunStarted,
  kRunEnded,
  kCalibrationPublished,
  kCalibrationRejected,
  kSegmentUnusable,
  kChangeDetected,
  kDataEvicted,            // a quota was reached
  kCalibrationActivated,   // manually
  kCalibrationRolledBack,  // manually
  kRunDeferred,
  kSegmentQuarantined,  // by a run, by its neighbours, or manually
  kCoresDisagree,       // a verification found a difference
  kRigUpdated,          // by hand, as the next two
  kRigDeleted,
  kSegmentDeleted,
  kTlsFilesRefused,  // of the daemon, without a rig
  kClockStepped,     // likewise
};

struct StoredEvent {
  // Counts from 1 for each name of a rig, over its deletion as well, and for
  // the daemon. At a hub it may be another one than on the device.
  std::int64_t event = 0;
  std::int64_t time_ns = 0;
  std::string rig;  // empty: of the daemon
  EventKind kind = EventKind::kRigCreated;
  std::string detail;
  std::int64_t steady_ns = 0;  // time_ns by steady time (Moment)
};

}  // namespace selfcal::server
