// The size of the database.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>

#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Bytes in use.
absl::StatusOr<std::int64_t> UsedBytes(UnitOfWork* tx);

}  // namespace selfcal::server
