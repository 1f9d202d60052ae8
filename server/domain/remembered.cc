#include "server/domain/remembered.h"

#include <cstddef>
#include <utility>

#include "server/domain/device_change.h"
#include "server/domain/exclusion.h"
#include "server/status/status_macros.h"
#include "server/store/runs.h"
#include "server/store/segment_ends.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {

absl::Status Remember(UnitOfWork* tx,
                      std::int64_t segment,
                      const SegmentEnds& ends) {
  SELFCAL_RETURN_IF_ERROR(WriteEnds(tx, segment, ends));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::int64_t> without_data,
                           EndsWithoutData(tx));
  for (std::size_t i = kRemembered; i < without_data.size(); ++i) {
    SELFCAL_RETURN_IF_ERROR(DeleteEnds(tx, without_data[i]));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<RememberedSegment>> ListRemembered(
    UnitOfWork* tx, std::int64_t run_number) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run, ReadRun(tx, run_number));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t first_sequence,
                           FirstSequenceSince(tx, run.change));
  SELFCAL_ASSIGN_OR_RETURN(std::vector<EndsRow> rows,
                           ReadEnds(tx, first_sequence, kMisfit));
  std::vector<RememberedSegment> remembered;
  for (EndsRow& row : rows) {
    if (!row.has_data && !row.ends) continue;
    remembered.push_back({.key = row.segment.key,
                          .ends = std::move(row.ends),
                          .fit = row.segment.fit,
                          .time_ns = row.segment.receive_steady_ns});
  }
  return remembered;
}

absl::StatusOr<std::vector<HeldOut>> ListHeldOut(UnitOfWork* tx,
                                                 std::int64_t run_number,
                                                 int limit) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run, ReadRun(tx, run_number));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t first_sequence,
                           FirstSequenceSince(tx, run.change));
  std::vector<HeldOut> held_out;
  SELFCAL_RETURN_IF_ERROR(VisitScored(
      tx,
      {.first_sequence = first_sequence,
       .not_in_run = run_number,
       .with_data_first = true,
       .limit = limit,
       .not_excluded_for = kMisfit},
      [&](const ScoredSegment& scored) {
        if (scored.information.ok()) {
          held_out.push_back(
              {scored.segment.key, scored.has_data, *scored.information});
        }
        return true;
      }));
  return held_out;
}

}  // namespace selfcal::server
