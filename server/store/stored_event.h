// Events: the log of what happened to rigs and to the daemon.
#pragma once

#include <cstdint>
#include <string>

namespace selfcal::server {

// The numbers are those on disk and in the contract (Event.Kind of
// store_service.proto) and never change.
enum class EventKind {
  kRigCreated = 1,
  kRunStarted = 2,
  kRunEnded = 3,
  kCalibrationPublished = 4,
  kCalibrationRejected = 5,
  kSegmentUnusable = 6,
  kChangeDetected = 7,
  kDataEvicted = 8,             // a quota was reached
  kCalibrationActivated = 9,    // manually
  kCalibrationRolledBack = 10,  // manually
  kRunDeferred = 11,
  kSegmentQuarantined = 12,  // by a run, by its neighbours, or manually
  kCoresDisagree = 13,       // a verification found a difference
  kRigUpdated = 14,          // by hand, as the next two
  kRigDeleted = 15,
  kSegmentDeleted = 16,
  kTlsFilesRefused = 17,  // of the daemon, without a rig
  kClockStepped = 18,     // likewise
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
