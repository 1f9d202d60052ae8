#include "server/store/database_size.h"

#include "server/status/status_macros.h"
#include "server/store/driver/driver.h"

namespace selfcal::server {

absl::StatusOr<std::int64_t> UsedBytes(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const DatabaseSize size, tx->db()->Size());
  return size.used_bytes;
}

}  // namespace selfcal::server
