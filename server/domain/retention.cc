#include "server/domain/retention.h"

#include <algorithm>
#include <functional>

#include "server/domain/device_change.h"
#include "server/domain/exclusion.h"
#include "server/domain/remembered.h"
#include "server/status/status_macros.h"
#include "server/store/change_rows.h"
#include "server/store/segment_rows.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

bool IsReferenced(const DataHolder& holder) {
  return holder.gain.has_value() || holder.in_unfinished_run;
}

// The smallest sequence of a segment of the reserve.
std::int64_t BeginOfReserve(const std::vector<DataHolder>& holders,
                            std::int64_t first_sequence) {
  std::vector<std::int64_t> sequences;
  for (const DataHolder& holder : holders) {
    if (holder.segment.state == SegmentState::kScored && !holder.gain &&
        !holder.excluded && holder.segment.sequence >= first_sequence) {
      sequences.push_back(holder.segment.sequence);
    }
  }
  std::sort(sequences.begin(), sequences.end(), std::greater<>());
  if (sequences.size() > kReserve) return sequences[kReserve - 1];
  return first_sequence;
}

}  // namespace

absl::StatusOr<std::vector<Table>> RemoveAgedEntries(UnitOfWork* tx,
                                                     const StoredRig& rig,
                                                     std::int64_t now_ns) {
  const std::int64_t max_age_ns = rig.policy.table_max_age_ns;
  if (max_age_ns > 0 && !tx->now().keeps_aged) {
    SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentRow> kept,
                             SegmentsInTables(tx));
    for (const SegmentRow& segment : kept) {
      if (segment.receive_steady_ns >= now_ns - max_age_ns) continue;
      SELFCAL_RETURN_IF_ERROR(LeaveTables(
          tx, segment.sequence, {.cause = ExclusionCause::kTooOld}));
    }
  }
  return ReadTables(tx);
}

absl::Status DropUnneededData(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<DataHolder> holders,
                           DataHolders(tx, kMisfit));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change, NewestChange(tx));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t first_sequence,
                           FirstSequenceSince(tx, change));
  const std::int64_t reserve = BeginOfReserve(holders, first_sequence);
  for (const DataHolder& holder : holders) {
    const bool in_reserve = holder.segment.state == SegmentState::kScored &&
                            !holder.excluded &&
                            holder.segment.sequence >= reserve;
    if (IsReferenced(holder) || in_reserve || holder.to_report) continue;
    SELFCAL_RETURN_IF_ERROR(DeleteData(tx, holder.segment.sequence));
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
