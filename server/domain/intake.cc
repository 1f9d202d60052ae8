#include "server/domain/intake.h"

#include <cstdint>

#include "server/domain/quotas.h"
#include "server/domain/report_data.h"
#include "server/domain/reports.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<bool> StoreSegment(UnitOfWork* tx,
                                  const NewSegment& segment,
                                  const Quotas& quotas) {
  SELFCAL_RETURN_IF_ERROR(CheckOwnRig(tx));
  const auto existing = FindSegment(tx, segment.key);
  if (existing.ok()) return false;
  if (!absl::IsNotFound(existing.status())) return existing.status();
  const auto bytes = static_cast<std::int64_t>(segment.payload.data.size());
  SELFCAL_RETURN_IF_ERROR(MakeRoom(tx, bytes, quotas));
  SELFCAL_RETURN_IF_ERROR(DropOldSegments(tx, quotas));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t sequence,
                           InsertSegment(tx, segment));
  SELFCAL_RETURN_IF_ERROR(ReportStoredData(tx, sequence, quotas));
  return true;
}

}  // namespace selfcal::server
