#include "server/store/database_size.h"

#include <fmt/format.h>

#include <algorithm>

#include "server/store/statement.h"
#include "server/store/status_macros.h"

namespace selfcal::server {

absl::Status LimitSize(Connection* db, std::int64_t max_bytes) {
  if (max_bytes == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t size,
                           ReadInt(db, "PRAGMA page_size"));
  return Statement(db,
                   fmt::format("PRAGMA max_page_count = {}",
                               std::max<std::int64_t>(1, max_bytes / size)))
      .Run();
}

absl::StatusOr<std::int64_t> UsedBytes(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t pages,
                           ReadInt(tx->db(), "PRAGMA page_count"));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t free,
                           ReadInt(tx->db(), "PRAGMA freelist_count"));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t size,
                           ReadInt(tx->db(), "PRAGMA page_size"));
  return (pages - free) * size;
}

}  // namespace selfcal::server
