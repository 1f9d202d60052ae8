// Records of device changes.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// NOT_FOUND.
absl::StatusOr<StoredChange> ReadChange(Connection* db,
                                        const std::string& rig,
                                        std::int64_t change);

// --- Within a unit of work.

// The number of the newest device change of the rig, 0 if there is none.
absl::StatusOr<std::int64_t> NewestChange(UnitOfWork* tx);
absl::StatusOr<StoredChange> ReadChange(UnitOfWork* tx, std::int64_t change);
absl::Status InsertChange(UnitOfWork* tx, const StoredChange& change);

}  // namespace selfcal::server
