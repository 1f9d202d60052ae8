// Keeps a rig within its quotas.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>

#include "server/domain/domain_options.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// RESOURCE_EXHAUSTED if there are more rigs than the quota allows, that of the
// unit of work included.
absl::Status CheckRigQuota(UnitOfWork* tx, const Quotas& quotas);

// Makes room for a segment of `bytes` that is about to be stored.
// RESOURCE_EXHAUSTED, naming the quota, if nothing may be evicted.
absl::Status MakeRoom(UnitOfWork* tx, std::int64_t bytes, const Quotas& quotas);

// Makes room for data of a rig that a device reports, by deleting that of the
// least informative segments, of which the device is told nothing. False if
// there is none.
absl::StatusOr<bool> MakeRoomForReported(UnitOfWork* tx,
                                         std::int64_t bytes,
                                         const Quotas& quotas);

// Deletes the records of segments that are older or more than the quotas allow,
// of at most two hundred segments in one call.
absl::Status DropOldSegments(UnitOfWork* tx, const Quotas& quotas);

}  // namespace selfcal::server
