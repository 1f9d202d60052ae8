// Summaries of many rigs. A page begins after the key of the last rig, so that
// a late page costs no more than the first.
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <string>
#include <string_view>

#include "server/store/driver/statement.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// A line for each label, between line feeds, as a parameter of RigCondition.
std::string LinesOf(const std::map<std::string, std::string>& labels);
// SQL condition on a row of rigs under this name: the text, the lines and the
// number of labels, and the whole name of a RigQuery are the values of the four
// parameters from this one on.
std::string RigCondition(std::string_view rigs, int first_parameter);

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
