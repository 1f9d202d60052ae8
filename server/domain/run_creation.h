// Creation of runs: by the tables, by an operator, or by the other triggers.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <optional>
#include <vector>

#include "core/selection/tables.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

struct RunReason {
  RunTrigger trigger = RunTrigger::kManual;
  const char* text = "";  // as the event of the run states it
};

// Creates a run on the present tables. FAILED_PRECONDITION if they are empty or
// a run is unfinished.
absl::StatusOr<StoredRun> CreateRun(UnitOfWork* tx,
                                    const std::vector<Table>& tables,
                                    const RunReason& reason);

// Creates the run that the tables call for (EvaluateTrigger), if no run is
// unfinished.
absl::StatusOr<std::optional<StoredRun>> CreateRunOfTables(
    UnitOfWork* tx, const StoredRig& rig, const std::vector<Table>& tables);

// True if the tables hold a segment that the run was not created with.
bool HoldAnother(const std::vector<Table>& tables, const StoredRun& run);

// Domain::CreateManualRun.
absl::StatusOr<StoredRun> CreateManualRun(UnitOfWork* tx, bool force);

// The snapshot of the newest run, with which the trigger compares the tables.
// How that run ended does not matter, so that a failure is not repeated on the
// same data. nullopt until the tables have started a run of their own since the
// last device change: a manual run on half-filled tables does not replace the
// run on the first full ones.
absl::StatusOr<std::optional<std::vector<SegmentKey>>> LastRunKeys(
    UnitOfWork* tx);

}  // namespace selfcal::server
