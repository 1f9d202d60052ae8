#include "server/domain/checks.h"

#include "server/domain/session_trigger.h"
#include "server/domain/time_triggers.h"
#include "server/status/status_macros.h"
#include "server/store/reporting_device.h"
#include "server/store/rig_checks.h"
#include "server/store/rigs.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {
namespace {

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
  TimeCheck check;
  SELFCAL_ASSIGN_OR_RETURN(const bool is_reported, IsReported(tx));
  if (!is_reported) {
    SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
    SELFCAL_ASSIGN_OR_RETURN(check, ApplyTimeTriggers(tx, rig, now_ns));
  }
  SELFCAL_RETURN_IF_ERROR(SetCheck(tx, RigCheck::kTime, check.next));
  return check.started;
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
