// Summaries of many rigs. A page begins after the key of the last rig, so that
// a late page costs no more than the first.
#pragma once

#include <absl/status/statusor.h>

#include "server/store/driver/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// INVALID_ARGUMENT for a token of another list or another query.
absl::StatusOr<Listed<RigSummary>> ListSummaryRows(Connection* db,
                                                   const RigQuery& query,
                                                   const Page& page);

// The same with the definitions of the rigs.
absl::StatusOr<Listed<StoredRig>> ListRigRows(Connection* db,
                                              const RigQuery& query,
                                              const Page& page);

}  // namespace selfcal::server
