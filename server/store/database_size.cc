#include "server/store/database_size.h"

#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<std::int64_t> UsedBytes(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const DatabaseSize size, tx->db()->Size());
  return size.used_bytes;
}

absl::StatusOr<std::optional<DiskSpace>> DiskOf(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(auto disk, tx->db()->Disk());
  if (!disk) return disk;
  SELFCAL_ASSIGN_OR_RETURN(const DatabaseSize size, tx->db()->Size());
  disk->free_bytes += size.bytes - size.used_bytes;
  return disk;
}

}  // namespace selfcal::server
