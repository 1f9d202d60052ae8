// Summaries of many rigs. A page begins after the key of the last rig, so that
// a late page costs no more than the first.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/store/driver/sql_condition.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Adds the conditions of a query, without its order, on a row of rigs under the
// name `rigs`. A list in the order of the keys of rigs names the parameter
// `from` that has the key of its first rig, so that labels are not read from
// their beginning.
void AddRigConditions(const RigQuery& query,
                      const std::string& rigs,
                      SqlCondition* condition,
                      const std::string& from = "");

// The filter of the query as a text, which identifies its list in page tokens.
std::string FilterText(const RigQuery& query);

// INVALID_ARGUMENT for a token of another list or another query.
absl::StatusOr<Listed<RigSummary>> ListSummaryRows(Connection* db,
                                                   const RigQuery& query,
                                                   const Page& page);

// Versions, tables, newest run and change, and device of the rig of a unit of
// work.
absl::StatusOr<RigSummary> ReadRigState(UnitOfWork* tx);

// The same with the definitions of the rigs.
absl::StatusOr<Listed<StoredRig>> ListRigRows(Connection* db,
                                              const RigQuery& query,
                                              const Page& page);

}  // namespace selfcal::server
