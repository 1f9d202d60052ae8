#include "server/domain/report_data.h"

#include <fmt/format.h>

#include "server/status/status_macros.h"
#include "server/store/events.h"
#include "server/store/outbox.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {

absl::Status ReportStoredData(UnitOfWork* tx,
                              std::int64_t sequence,
                              const Quotas& quotas) {
  SELFCAL_ASSIGN_OR_RETURN(const ReportedData data, ReportedDataOf(tx));
  if (data != ReportedData::kAll) return absl::OkStatus();
  tx->Changed(RecordKind::kData, sequence);
  const std::int64_t limit = quotas.max_unreported_bytes_per_rig;
  if (limit == 0) return absl::OkStatus();
  for (;;) {
    SELFCAL_ASSIGN_OR_RETURN(const WaitingData waiting, DataInOutbox(tx));
    if (waiting.segments == 0 || waiting.bytes <= limit) break;
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t dropped, DropOldestData(tx));
    if (dropped == 0) break;
    SELFCAL_RETURN_IF_ERROR(AppendEvent(
        tx,
        EventKind::kDataEvicted,
        fmt::format("the data of segment {} (by order of arrival) is not "
                    "reported to the hub: {} bytes wait for that, of at most "
                    "{}; the hub could not be reached for too long",
                    dropped,
                    waiting.bytes,
                    limit)));
  }
  return absl::OkStatus();
}

absl::Status ReportKeptData(UnitOfWork* tx, std::int64_t sequence) {
  SELFCAL_ASSIGN_OR_RETURN(const ReportedData data, ReportedDataOf(tx));
  if (data != ReportedData::kKept) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const bool has_data, HasData(tx, sequence));
  if (has_data) tx->Changed(RecordKind::kData, sequence);
  return absl::OkStatus();
}

}  // namespace selfcal::server
