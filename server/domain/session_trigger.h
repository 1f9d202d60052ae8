// A session that ends may start a run: the active version shall be computed on
// the tables as the session leaves them, however little has changed since the
// rule of change last fired, and on the memory once that is half as large
// again.
#pragma once

#include <absl/status/statusor.h>

#include <optional>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// True if a run is due when the session of the rig ends (CreateSessionRun).
// Reads only.
absl::StatusOr<bool> IsSessionRunDue(UnitOfWork* tx);

// The run of a rig whose session has ended. Only where the tables have started
// a run before (since the last device change), no run is unfinished, all
// segments are scored, and one of these holds: the tables contain a segment
// that the newest run was not created with; a segment that this run used is
// unusable by now; a third of the segments with ends arrived after it was
// created.
absl::StatusOr<std::optional<StoredRun>> CreateSessionRun(UnitOfWork* tx);

}  // namespace selfcal::server
