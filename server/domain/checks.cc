#include "server/domain/checks.h"

#include <algorithm>

#include "server/domain/age_trigger.h"
#include "server/domain/session_trigger.h"
#include "server/status/status_macros.h"
#include "server/store/report.h"
#include "server/store/rig_checks.h"
#include "server/store/rigs.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {
namespace {

// A rule about time, which may create a run of a rig with a policy to which it
// applies.
struct TimeTrigger {
  bool (*applies)(const RigPolicy& policy);
  // The steady time from which on it may, if no record of the rig changes
  // before; kNoCheck: it may not.
  absl::StatusOr<std::int64_t> (*due)(UnitOfWork* tx, const StoredRig& rig);
  absl::StatusOr<std::optional<StoredRun>> (*create_run)(UnitOfWork* tx,
                                                         const StoredRig& rig,
                                                         std::int64_t now_ns);
};

constexpr TimeTrigger kTimeTriggers[] = {
    {[](const RigPolicy& policy) { return policy.calibration_max_age_ns > 0; },
     AgedRunDue,
     CreateAgedRun},
};

// Rules about time apply this much later to what has changed, so that a rig
// that changes all the time is checked once in a while.
constexpr std::int64_t kTimeCheckDelayNs = 60'000'000'000;

// A device checks the rigs that it reports itself.
absl::StatusOr<bool> IsReported(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const auto device, ReadReportingDevice(tx));
  return device.has_value();
}

}  // namespace

absl::Status RequestChecksAfterChange(UnitOfWork* tx) {
  if (tx->changed().empty()) return absl::OkStatus();
  if (tx->changed().contains({RecordKind::kRig, 0})) {
    SELFCAL_RETURN_IF_ERROR(SetCheck(tx, RigCheck::kTime, 0));
  }
  return RequestChecks(tx, tx->now().steady_ns + kTimeCheckDelayNs);
}

absl::StatusOr<std::optional<StoredRun>> CheckTimes(UnitOfWork* tx,
                                                    std::int64_t now_ns) {
  std::optional<StoredRun> started;
  std::optional<std::int64_t> next;
  SELFCAL_ASSIGN_OR_RETURN(const bool is_reported, IsReported(tx));
  if (!is_reported) {
    SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
    for (const TimeTrigger& trigger : kTimeTriggers) {
      if (!trigger.applies(rig.policy)) continue;
      SELFCAL_ASSIGN_OR_RETURN(std::int64_t due, trigger.due(tx, rig));
      if (due <= now_ns) {
        due = kNoCheck;
        if (!started) {
          SELFCAL_ASSIGN_OR_RETURN(started,
                                   trigger.create_run(tx, rig, now_ns));
        }
      }
      next = std::min(next.value_or(kNoCheck), due);
    }
  }
  SELFCAL_RETURN_IF_ERROR(SetCheck(tx, RigCheck::kTime, next));
  return started;
}

absl::StatusOr<std::optional<StoredRun>> CheckSession(
    UnitOfWork* tx, std::int64_t idle_since_ns) {
  std::optional<StoredRun> started;
  std::int64_t next = kNoCheck;
  SELFCAL_ASSIGN_OR_RETURN(const bool is_reported, IsReported(tx));
  if (!is_reported) {
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestArrival(tx));
    if (newest > idle_since_ns) {
      next = newest;
    } else {
      SELFCAL_ASSIGN_OR_RETURN(started, CreateSessionRun(tx));
    }
  }
  SELFCAL_RETURN_IF_ERROR(SetCheck(tx, RigCheck::kSession, next));
  return started;
}

}  // namespace selfcal::server
