#include "server/domain/intake.h"

#include <cstdint>

#include "server/domain/quotas.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<bool> StoreSegment(UnitOfWork* tx,
                                  const NewSegment& segment,
                                  const Quotas& quotas) {
  const auto existing = FindSegment(tx, segment.key);
  if (existing.ok()) return false;
  if (!absl::IsNotFound(existing.status())) return existing.status();
  const auto bytes = static_cast<std::int64_t>(segment.payload.data.size());
  SELFCAL_RETURN_IF_ERROR(MakeRoom(tx, bytes, quotas));
  SELFCAL_RETURN_IF_ERROR(DropOldSegments(tx, quotas));
  SELFCAL_RETURN_IF_ERROR(InsertSegment(tx, segment));
  return true;
}

}  // namespace selfcal::server
