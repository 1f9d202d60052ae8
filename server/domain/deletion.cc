#include "server/domain/deletion.h"

#include <fmt/format.h>

#include "server/domain/reports.h"
#include "server/status/status_macros.h"
#include "server/store/events.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {

absl::StatusOr<bool> DeleteSegment(UnitOfWork* tx,
                                   const SegmentKey& key,
                                   const std::string& caller,
                                   const std::string& reason) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment, FindSegment(tx, key));
  SELFCAL_ASSIGN_OR_RETURN(const SegmentUsers users,
                           UsersOf(tx, segment.sequence));
  const std::string text = SegmentText(tx->rig(), key);
  if (users.unfinished_run) {
    return absl::FailedPreconditionError(
        fmt::format("run {} uses {}; cancel it, or try again when it has ended",
                    *users.unfinished_run,
                    text));
  }
  if (users.version) {
    return absl::FailedPreconditionError(fmt::format(
        "version {} was computed from {}, and a version keeps its origin; "
        "quarantine the segment so that no later version uses it, or delete "
        "the rig",
        *users.version,
        text));
  }
  SELFCAL_RETURN_IF_ERROR(DeleteSegment(tx, segment.sequence));
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(tx,
                  EventKind::kSegmentDeleted,
                  fmt::format("{} by {}: {}", text, caller, reason)));
  return segment.state == SegmentState::kStored;
}

absl::StatusOr<int> DeleteRig(UnitOfWork* tx,
                              const std::string& caller,
                              const std::string& reason) {
  // The hub neither scores nor computes a rig that a device reports.
  const bool is_own = CheckOwnRig(tx).ok();
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t unfinished, UnfinishedRun(tx));
  if (is_own && unfinished != 0) {
    return absl::FailedPreconditionError(
        fmt::format("run {} of rig {} has not ended; cancel it first",
                    unfinished,
                    tx->rig()));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t unscored, CountUnscored(tx));
  if (is_own) {
    SELFCAL_RETURN_IF_ERROR(AppendEvent(
        tx, EventKind::kRigDeleted, fmt::format("by {}: {}", caller, reason)));
  } else {
    // The events of the rig are those of its device.
    SELFCAL_RETURN_IF_ERROR(
        InsertEvent(tx->db(),
                    {0,
                     tx->time_ns(),
                     "",
                     EventKind::kRigDeleted,
                     fmt::format("rig {}, which its device reports, by {}: {}",
                                 tx->rig(),
                                 caller,
                                 reason),
                     tx->now().steady_ns})
            .status());
  }
  SELFCAL_RETURN_IF_ERROR(DeleteRigRows(tx));
  return is_own ? static_cast<int>(unscored) : 0;
}

}  // namespace selfcal::server
