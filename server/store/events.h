// The append-only log of what happened, in the database.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>

#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// Within the transaction that does what the event tells.
absl::Status AppendEvent(Connection* db,
                         const std::string& rig,
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
