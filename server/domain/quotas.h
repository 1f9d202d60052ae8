// Keeps a rig within its quotas.
#pragma once

#include <absl/status/status.h>

#include <cstdint>

#include "server/domain/domain_options.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// RESOURCE_EXHAUSTED if there are more rigs than the quota allows, that of the
// unit of work included.
absl::Status CheckRigQuota(UnitOfWork* tx, const Quotas& quotas);

// Makes room for a segment of `bytes` that is about to be stored.
// RESOURCE_EXHAUSTED, naming the quota, where nothing may be evicted.
absl::Status MakeRoom(UnitOfWork* tx, std::int64_t bytes, const Quotas& quotas);

// Drops metadata that is older or more than the quotas allow, at most that of a
// hundred segments at a time.
absl::Status DropOldSegments(UnitOfWork* tx, const Quotas& quotas);

}  // namespace selfcal::server
