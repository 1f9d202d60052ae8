// Runs because the active calibration is old.
#include <algorithm>

#include "server/store/calibrations.h"
#include "server/store/changes.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

absl::StatusOr<std::int64_t> ActiveSince(Connection* db,
                                         std::int64_t activation) {
  return ReadInt(
      db, "SELECT time_ns FROM activations WHERE activation = ?1", activation);
}

bool HoldsAnother(const std::vector<Table>& tables, const StoredRun& last) {
  const auto entries = UnionOfTables(tables);
  return std::any_of(entries.begin(), entries.end(), [&](const auto& entry) {
    return std::find(last.segments.begin(), last.segments.end(), entry.key) ==
           last.segments.end();
  });
}

absl::StatusOr<std::optional<StoredRun>> MaybeInsertAgedRun(
    Connection* db, const RigRow& rig, std::int64_t now_ns) {
  const std::optional<StoredRun> none;
  const std::int64_t before = now_ns - rig.stored.policy.calibration_max_age_ns;
  const auto active = ReadActiveCalibration(db, rig.stored.rig.id);
  if (absl::IsDataLoss(active.status())) {
    return none;
  }
  SELFCAL_RETURN_IF_ERROR(active.status());
  if (!active->run) {
    return none;
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t since,
                           ActiveSince(db, active->activation));
  SELFCAL_ASSIGN_OR_RETURN(const auto runs,
                           ListRunRows(db, rig.stored.rig.id, {1, ""}));
  if (since > before || runs.items.empty()) {
    return none;
  }
  const StoredRun& last = runs.items.front();
  if (last.end_time_ns == 0 || last.create_time_ns > before) {
    return none;
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           ReadFreshTables(db, rig, now_ns));
  if (!HoldsAnother(tables, last)) {
    return none;
  }
  SELFCAL_ASSIGN_OR_RETURN(
      StoredRun run, InsertRun(db, rig, tables, RunTrigger::kCalibrationAged));
  return run;
}

absl::StatusOr<std::vector<std::string>> RigIds(Connection* db) {
  Statement read(db, "SELECT id FROM rigs ORDER BY rig");
  std::vector<std::string> ids;
  while (read.Next()) {
    ids.push_back(read.Text(0));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return ids;
}

}  // namespace

absl::StatusOr<std::vector<StoredRun>> StartAgedRunRows(Connection* db,
                                                        std::int64_t now_ns) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  std::vector<StoredRun> started;
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::string> ids, RigIds(db));
  for (const std::string& id : ids) {
    const auto rig = ReadRig(db, id);
    // A damaged one must not hold up the others.
    if (!rig.ok() || rig->stored.policy.calibration_max_age_ns <= 0) {
      continue;
    }
    SELFCAL_ASSIGN_OR_RETURN(auto run, MaybeInsertAgedRun(db, *rig, now_ns));
    if (run) {
      started.push_back(*std::move(run));
    }
  }
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return started;
}

}  // namespace selfcal::server
