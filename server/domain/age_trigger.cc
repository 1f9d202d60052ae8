#include "server/domain/age_trigger.h"

#include <algorithm>
#include <vector>

#include "server/domain/retention.h"
#include "server/domain/run_creation.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/rig_checks.h"
#include "server/store/runs.h"

namespace selfcal::server {

absl::StatusOr<std::int64_t> AgedRunDue(UnitOfWork* tx, const StoredRig& rig) {
  if (rig.policy.calibration_max_age_ns <= 0) return kNoCheck;
  const auto active = ReadActiveCalibration(tx);
  if (absl::IsDataLoss(active.status())) return kNoCheck;
  SELFCAL_RETURN_IF_ERROR(active.status());
  if (!active->run) return kNoCheck;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t since,
                           ActivationSteadyTime(tx, active->activation));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestRun(tx));
  if (newest == 0) return kNoCheck;
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun last, ReadRun(tx, newest));
  if (last.end_time_ns == 0) return kNoCheck;
  return std::max(since, last.create_steady_ns) +
         rig.policy.calibration_max_age_ns;
}

absl::StatusOr<std::optional<StoredRun>> CreateAgedRun(UnitOfWork* tx,
                                                       const StoredRig& rig,
                                                       std::int64_t now_ns) {
  const std::optional<StoredRun> none;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t due, AgedRunDue(tx, rig));
  if (due > now_ns) return none;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestRun(tx));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun last, ReadRun(tx, newest));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           RemoveAgedEntries(tx, rig, now_ns));
  if (!HoldAnother(tables, last)) return none;
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run,
                           CreateRun(tx, tables, RunTrigger::kCalibrationAged));
  return run;
}

}  // namespace selfcal::server
