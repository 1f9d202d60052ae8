// Alarms: reasons for an operator to look at a rig. They are stored with it, so
// that a list of the rigs that need attention reads no others.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The numbers are positions of bits in the column rigs.alarms: only ever
// extended. A higher one is more urgent.
enum class Alarm {
  kSilent = 0,  // its device has not reported for a day
  kTableStarved = 1,
  kRunFailed = 2,      // the newest one
  kRejected = 3,       // the newest version
  kDeviceChanged = 4,  // since the run of the active version
  kUnlikeCohort = 5,   // the active version contradicts the cohort of the rig
};

constexpr std::int64_t BitOf(Alarm alarm) {
  return std::int64_t{1} << static_cast<int>(alarm);
}

inline constexpr std::int64_t kSilentAfterNs =
    std::int64_t{24} * 3600 * 1'000'000'000;

// The most urgent first. `now_ns` is the time, since the Unix epoch.
std::vector<Alarm> AlarmsOf(const RigSummary& rig, std::int64_t now_ns);

// --- Within a unit of work.

// Stores the alarms of the rig as its records are now.
absl::Status StoreAlarms(UnitOfWork* tx);
// Does so if the unit of work has changed a record on which they depend.
// Neither the time nor the cohort of the rig is one: Domain::NoteSilentDevices
// and Domain::NoteOutliers store what these change.
absl::Status UpdateAlarms(UnitOfWork* tx);

}  // namespace selfcal::server
