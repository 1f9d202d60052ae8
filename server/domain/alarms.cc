#include "server/domain/alarms.h"

#include <algorithm>

#include "server/status/status_macros.h"
#include "server/store/rig_lists.h"
#include "server/store/rigs.h"

namespace selfcal::server {

std::vector<Alarm> AlarmsOf(const RigSummary& rig, std::int64_t now_ns) {
  std::vector<Alarm> alarms;
  if (rig.unlike_cohort != 0 && rig.unlike_cohort == rig.active_version) {
    alarms.push_back(Alarm::kUnlikeCohort);
  }
  if (rig.changed_since != 0) {
    alarms.push_back(Alarm::kDeviceChanged);
  }
  if (rig.newest_state == CalibrationState::kRejected) {
    alarms.push_back(Alarm::kRejected);
  }
  if (rig.newest_run != 0 && rig.run_state == RunState::kFailed) {
    alarms.push_back(Alarm::kRunFailed);
  }
  const bool is_starved =
      std::any_of(rig.tables.begin(), rig.tables.end(), [](const Table& table) {
        return table.starved();
      });
  if (is_starved) alarms.push_back(Alarm::kTableStarved);
  if (rig.device && now_ns - rig.device->time_ns > kSilentAfterNs) {
    alarms.push_back(Alarm::kSilent);
  }
  return alarms;
}

absl::Status StoreAlarms(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const RigSummary summary, ReadRigState(tx));
  std::int64_t bits = 0;
  for (const Alarm alarm : AlarmsOf(summary, tx->time_ns())) {
    bits |= BitOf(alarm);
  }
  return WriteAlarms(tx, bits);
}

absl::Status UpdateAlarms(UnitOfWork* tx) {
  constexpr RecordKind kKinds[] = {RecordKind::kTables,
                                   RecordKind::kRun,
                                   RecordKind::kCalibration,
                                   RecordKind::kActivation,
                                   RecordKind::kChange};
  const bool depend = std::any_of(
      tx->changed().begin(), tx->changed().end(), [&](const auto& changed) {
        return std::find(std::begin(kKinds), std::end(kKinds), changed.first) !=
               std::end(kKinds);
      });
  return depend ? StoreAlarms(tx) : absl::OkStatus();
}

}  // namespace selfcal::server
