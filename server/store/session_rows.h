// Records of sessions and of their segments.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/store/driver/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// Steps from one name to the next in an index, however many segments each
// session has.
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
