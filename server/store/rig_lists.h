// Summaries of many rigs. A page begins after the key of the last rig, so that
// a late page costs no more than the first.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>
#include <vector>

#include "server/store/driver/statement.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The condition of a query on rigs, without its order.
class RigCondition {
 public:
  // On a row of rigs under the name `rigs`. Its parameters are numbered from
  // `first_parameter` on.
  RigCondition(const RigQuery& query,
               std::string_view rigs,
               int first_parameter);

  // A condition of SQL; "TRUE" for every rig.
  const std::string& sql() const { return sql_; }
  bool is_every_rig() const { return values_.empty() && sql_ == "TRUE"; }
  // Binds its parameters, which must be the next ones of the statement.
  void Bind(Statement* statement) const;

 private:
  // Adds a value; returns its parameter.
  std::string Parameter(std::string_view value);
  std::string HasLabel(const std::string& name, const std::string& value);
  void And(const std::string& condition);

  std::string rigs_;
  int next_;
  std::string sql_ = "TRUE";
  std::vector<std::string> values_;
};

// What the filter of the query says, to identify its list in page tokens.
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
