// Sessions and the way of each, in the database.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// Goes from one name to the next in an index, however many segments each has.
absl::StatusOr<Listed<SessionSummary>> ListSessionRows(Connection* db,
                                                       const std::string& rig,
                                                       const Page& page);

// NOT_FOUND.
absl::StatusOr<SessionSummary> ReadSession(Connection* db,
                                           const std::string& rig,
                                           const std::string& session);

absl::StatusOr<Listed<SessionSegment>> ListSessionSegmentRows(
    Connection* db,
    const std::string& rig,
    const std::string& session,
    const Page& page);

}  // namespace selfcal::server
