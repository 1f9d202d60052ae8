#include "server/domain/quarantine.h"

#include <fmt/format.h>

#include "server/domain/exclusion.h"
#include "server/domain/retention.h"
#include "server/status/status_macros.h"
#include "server/store/events.h"
#include "server/store/runs.h"
#include "server/store/segment_ends.h"

namespace selfcal::server {
namespace {

absl::Status NothingStored(const std::string& rig,
                           const std::string& session,
                           std::optional<std::int64_t> index) {
  return absl::NotFoundError(
      index
          ? fmt::format("{} is not stored", SegmentText(rig, {session, *index}))
          : fmt::format(
                "no segment of session {} of rig {} is stored", session, rig));
}

absl::Status MakeUnusable(UnitOfWork* tx,
                          std::int64_t segment,
                          const std::string& problem) {
  SELFCAL_RETURN_IF_ERROR(WriteUnusable(tx, segment, problem));
  SELFCAL_RETURN_IF_ERROR(DeleteEnds(tx, segment));
  return LeaveTables(tx, segment, {.cause = ExclusionCause::kUnusable});
}

}  // namespace

absl::Status Quarantine(UnitOfWork* tx,
                        const SegmentRow& segment,
                        EventKind event,
                        const std::string& problem) {
  SELFCAL_RETURN_IF_ERROR(MakeUnusable(tx, segment.sequence, problem));
  return AppendEvent(
      tx,
      event,
      fmt::format("{}: {}", SegmentText(tx->rig(), segment.key), problem));
}

absl::Status QuarantineExcluded(UnitOfWork* tx,
                                std::int64_t run,
                                const std::vector<SegmentFit>& fits) {
  for (const SegmentFit& fit : fits) {
    if (fit.excluded.empty()) continue;
    const auto found = FindSegment(tx, fit.key);
    // A segment without a record is not a reason to lose the calibration.
    if (absl::IsNotFound(found.status())) continue;
    SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment, found);
    SELFCAL_RETURN_IF_ERROR(MarkExcluded(tx, run, segment.sequence));
    if (segment.state == SegmentState::kUnusable) continue;
    SELFCAL_RETURN_IF_ERROR(Quarantine(
        tx,
        segment,
        EventKind::kSegmentQuarantined,
        fmt::format("quarantined by run {}: {}", run, fit.excluded)));
  }
  return absl::OkStatus();
}

absl::Status MarkUnusable(UnitOfWork* tx,
                          const SegmentKey& key,
                          const std::string& problem) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment, FindSegment(tx, key));
  if (segment.state == SegmentState::kUnusable) {
    return absl::OkStatus();
  }
  SELFCAL_RETURN_IF_ERROR(
      Quarantine(tx, segment, EventKind::kSegmentUnusable, problem));
  return DropUnneededData(tx);
}

absl::StatusOr<QuarantineCommit> QuarantineSegments(
    UnitOfWork* tx,
    const std::string& session,
    std::optional<std::int64_t> index,
    const std::string& caller,
    const std::string& reason) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentRow> segments,
                           SegmentsOfSession(tx, session, index));
  if (segments.empty()) return NothingStored(tx->rig(), session, index);
  QuarantineCommit commit;
  for (const SegmentRow& segment : segments) {
    if (segment.state == SegmentState::kUnusable) {
      ++commit.unusable;
      continue;
    }
    ++commit.quarantined;
    if (segment.state == SegmentState::kStored) {
      commit.unscored_sequences.push_back(segment.sequence);
    }
    SELFCAL_RETURN_IF_ERROR(
        MakeUnusable(tx,
                     segment.sequence,
                     fmt::format("quarantined by {}: {}", caller, reason)));
  }
  if (commit.quarantined == 0) return commit;
  const std::string what =
      index ? SegmentText(tx->rig(), segments.front().key)
            : fmt::format("{} {} of session {} of rig {}",
                          commit.quarantined,
                          commit.quarantined == 1 ? "segment" : "segments",
                          session,
                          tx->rig());
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(tx,
                  EventKind::kSegmentQuarantined,
                  fmt::format("{} by {}: {}", what, caller, reason)));
  SELFCAL_RETURN_IF_ERROR(DropUnneededData(tx));
  return commit;
}

}  // namespace selfcal::server
