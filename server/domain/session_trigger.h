// The trigger at the end of a session. The active version is to be computed on
// the tables as the session leaves them, however little they have changed since
// the last run, and again once the remembered segments have grown by half.
#pragma once

#include <absl/status/statusor.h>

#include <optional>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Creates the run of a rig whose session has ended, if one is due: the tables
// have started a run before (since the last device change), no run is
// unfinished, all segments are scored, and one of these holds: the tables
// contain a segment that the newest run was not created with; a segment that
// this run used has become unusable; a third of the segments with ends arrived
// after it was created.
absl::StatusOr<std::optional<StoredRun>> CreateSessionRun(UnitOfWork* tx);

}  // namespace selfcal::server
