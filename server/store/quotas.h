// Keeps a rig within its quotas. Called inside the transaction that stores a
// segment.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>

#include "server/store/statement.h"
#include "server/store/store_options.h"

namespace selfcal::server {

// The hard limit of the file, and none where the quota is 0.
absl::Status LimitDatabase(Connection* db, const Quotas& quotas);

// Makes room for a segment of `bytes` that is about to be stored.
// RESOURCE_EXHAUSTED, naming the quota, where nothing may be evicted.
absl::Status MakeRoom(Connection* db,
                      std::int64_t rig,
                      const std::string& rig_name,
                      std::int64_t bytes,
                      const Quotas& quotas);

// Drops metadata that is older or more than the quotas allow, at most a
// hundred segments at a time.
absl::Status DropOldSegments(Connection* db,
                             std::int64_t rig,
                             const std::string& rig_name,
                             const Quotas& quotas);

}  // namespace selfcal::server
