// The append-only log of what happened, in the database.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

absl::Status AppendEvent(UnitOfWork* tx,
                         EventKind kind,
                         const std::string& detail);

// Of one rig, or with an empty name of all; oldest first.
absl::StatusOr<Listed<StoredEvent>> ListEventRows(Connection* db,
                                                  const Page& page,
                                                  const std::string& rig);
absl::StatusOr<Listed<StoredEvent>> ListNewestEventRows(Connection* db,
                                                        const Page& page,
                                                        const std::string& rig);

}  // namespace selfcal::server
