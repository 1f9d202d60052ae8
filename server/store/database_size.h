// The size of the database.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>

#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Limits the size of the file; 0 for no limit.
absl::Status LimitSize(Connection* db, std::int64_t max_bytes);

// Bytes in use.
absl::StatusOr<std::int64_t> UsedBytes(UnitOfWork* tx);

}  // namespace selfcal::server
