// The life of a calibration:
//
//   candidate -> active       it was validated
//   candidate -> rejected     it was not; the end
//   active -> superseded      a newer one became active
//   active -> rolled back     an older one was made active by hand
//   superseded -> active      by hand
//   rolled back -> active     by hand
//
// The factory's version begins as active, every other as a candidate. Triggers
// of the schema refuse everything else, whoever asks.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>

#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

bool MayBecome(CalibrationState from, CalibrationState to);

// "rolled back".
const char* StateName(CalibrationState state);

// The rest runs inside a transaction of the caller, and the version exists.

// FAILED_PRECONDITION where it may not.
absl::Status ChangeState(Connection* db,
                         std::int64_t rig,
                         std::int64_t version,
                         CalibrationState from,
                         CalibrationState to);

// Makes a version of that state the active one. What was active becomes
// superseded, or is rolled back.
absl::Status MakeActive(Connection* db,
                        std::int64_t rig,
                        std::int64_t version,
                        CalibrationState from,
                        CalibrationState active_becomes);

// Writes down that a version became active: who watches is told in the order
// of these.
absl::Status InsertActivation(Connection* db,
                              std::int64_t rig,
                              std::int64_t version);

}  // namespace selfcal::server
