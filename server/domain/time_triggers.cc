#include "server/domain/time_triggers.h"

#include <algorithm>
#include <vector>

#include "server/domain/retention.h"
#include "server/domain/run_creation.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/rig_checks.h"
#include "server/store/runs.h"

namespace selfcal::server {
namespace {

struct TimeTrigger {
  RunReason reason;
  bool (*applies)(const RigPolicy& policy);
  // TimeCheck::next. Called if no run is unfinished.
  absl::StatusOr<std::int64_t> (*due)(UnitOfWork* tx,
                                      const StoredRig& rig,
                                      const StoredRun& last);
};

// The active calibration must be the result of a run and have been active for
// as long as the policy of the rig allows, and the last run must have been
// created as long ago.
absl::StatusOr<std::int64_t> AgedRunDue(UnitOfWork* tx,
                                        const StoredRig& rig,
                                        const StoredRun& last) {
  const auto active = ReadActiveCalibration(tx);
  if (absl::IsDataLoss(active.status())) return kNoCheck;
  SELFCAL_RETURN_IF_ERROR(active.status());
  if (!active->run) return kNoCheck;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t since,
                           ActivationSteadyTime(tx, active->activation));
  return std::max(since, last.create_steady_ns) +
         rig.policy.calibration_max_age_ns;
}

constexpr TimeTrigger kTriggers[] = {
    {{RunTrigger::kCalibrationAged, "the calibration is old"},
     [](const RigPolicy& policy) { return policy.calibration_max_age_ns > 0; },
     AgedRunDue},
};

// The newest run; nullopt if there is none, or it is unfinished.
absl::StatusOr<std::optional<StoredRun>> LastRun(UnitOfWork* tx) {
  std::optional<StoredRun> last;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestRun(tx));
  if (newest == 0) return last;
  SELFCAL_ASSIGN_OR_RETURN(last, ReadRun(tx, newest));
  if (last->end_time_ns == 0) last.reset();
  return last;
}

// The run of a trigger that is due, unless it would repeat the last one.
absl::StatusOr<std::optional<StoredRun>> CreateDueRun(UnitOfWork* tx,
                                                      const StoredRig& rig,
                                                      const StoredRun& last,
                                                      const RunReason& reason,
                                                      std::int64_t now_ns) {
  std::optional<StoredRun> started;
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           RemoveAgedEntries(tx, rig, now_ns));
  if (!HoldAnother(tables, last)) return started;
  SELFCAL_ASSIGN_OR_RETURN(started, CreateRun(tx, tables, reason));
  return started;
}

}  // namespace

absl::StatusOr<TimeCheck> ApplyTimeTriggers(UnitOfWork* tx,
                                            const StoredRig& rig,
                                            std::int64_t now_ns) {
  TimeCheck check;
  std::vector<const TimeTrigger*> triggers;
  for (const TimeTrigger& trigger : kTriggers) {
    if (trigger.applies(rig.policy)) triggers.push_back(&trigger);
  }
  if (triggers.empty()) return check;
  check.next = kNoCheck;
  SELFCAL_ASSIGN_OR_RETURN(const auto last, LastRun(tx));
  if (!last) return check;
  for (const TimeTrigger* trigger : triggers) {
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t due,
                             trigger->due(tx, rig, *last));
    if (due > now_ns) {
      check.next = std::min(*check.next, due);
    } else if (!check.started) {
      SELFCAL_ASSIGN_OR_RETURN(
          check.started, CreateDueRun(tx, rig, *last, trigger->reason, now_ns));
    }
  }
  return check;
}

}  // namespace selfcal::server
