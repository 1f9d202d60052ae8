#include "server/store/rig_work.h"

#include <algorithm>
#include <iterator>

#include "server/status/status_macros.h"
#include "server/store/driver/sql_condition.h"
#include "server/store/driver/statement.h"
#include "server/store/own_rig.h"

namespace selfcal::server {
namespace {

constexpr std::ptrdiff_t kRigsOfQuery = 1000;

}  // namespace

absl::StatusOr<Store::WorkCount> CountWorkRows(Connection* db) {
  Statement read(
      db,
      "SELECT "
      "(SELECT COUNT(*) FROM segments s WHERE s.state = 1 AND " +
          IsOwnRig("s.rig") +
          "), "
          "(SELECT COUNT(*) FROM runs r WHERE r.state IN (1, 2) AND " +
          IsOwnRig("r.rig") + ")");
  Store::WorkCount work;
  if (read.Next()) work = {read.Int(0), read.Int(1)};
  SELFCAL_RETURN_IF_ERROR(read.status());
  return work;
}

absl::StatusOr<std::set<std::string>> BusyRigs(
    Connection* db, const std::set<std::string>& rigs) {
  std::set<std::string> busy;
  for (auto begin = rigs.begin(); begin != rigs.end();) {
    const auto end = std::next(
        begin, std::min(kRigsOfQuery, std::distance(begin, rigs.end())));
    SqlCondition condition;
    condition.AndOneOf("r.id", std::set<std::string>(begin, end));
    condition.And(
        "(EXISTS (SELECT 1 FROM segments s WHERE s.state = 1 "
        "  AND s.rig = r.rig) "
        "OR EXISTS (SELECT 1 FROM runs u WHERE u.state IN (1, 2) "
        "  AND u.rig = r.rig)) "
        "AND " +
        IsOwnRig("r.rig"));
    Statement read(db,
                   condition.reuse(),
                   "SELECT r.id FROM rigs r WHERE " + condition.sql());
    condition.Bind(&read);
    while (read.Next()) busy.insert(read.Text(0));
    SELFCAL_RETURN_IF_ERROR(read.status());
    begin = end;
  }
  return busy;
}

}  // namespace selfcal::server
