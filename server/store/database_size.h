// The size of the database, and what the disk has room for.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>

#include "server/store/driver/driver.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Bytes in use.
absl::StatusOr<std::int64_t> UsedBytes(UnitOfWork* tx);

// The file system of the database, if it is a file. Room in the file that later
// records can fill counts as free.
absl::StatusOr<std::optional<DiskSpace>> DiskOf(UnitOfWork* tx);

}  // namespace selfcal::server
