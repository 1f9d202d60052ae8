// The life of a run: pending -> running -> succeeded, failed or cancelled.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// As the methods of Domain.
absl::Status DeferRun(UnitOfWork* tx,
                      std::int64_t run,
                      const std::string& reason);
absl::StatusOr<StoredRun> BeginRun(UnitOfWork* tx, std::int64_t run);
absl::StatusOr<StoredRun> ReleaseRun(UnitOfWork* tx, std::int64_t run);
absl::StatusOr<StoredRun> EndRun(UnitOfWork* tx,
                                 std::int64_t run,
                                 RunState state,
                                 const std::string& message);

// FAILED_PRECONDITION if the run is not running.
absl::StatusOr<StoredRun> ReadRunningRun(UnitOfWork* tx, std::int64_t run);

// Writes the state of a run that has ended, and the event. Scores that it has
// written at its candidate are outdated from then on (outdated_scores.h).
absl::Status WriteEnd(UnitOfWork* tx, const StoredRun& run);

}  // namespace selfcal::server
