// Reads several versions: the pages of a list, and reports of solvers.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>
#include <map>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/calibration_rows.h"
#include "server/store/calibrations.h"
#include "server/store/driver/statement.h"
#include "server/store/paging.h"
#include "server/store/query_conditions.h"
#include "server/store/records.h"
#include "server/store/rig_lists.h"
#include "server/store/rigs.h"
#include "server/store/row_order.h"

namespace selfcal::server {
namespace {

// The key of a rig, and the number of a version of it.
using VersionKey = std::pair<std::int64_t, std::int64_t>;

std::string CalibrationListName(const std::string& rig,
                                const CalibrationQuery& query,
                                const RigQuery& of) {
  std::string name = rig.empty() ? "calibrations of many " + FilterText(of)
                                 : "calibrations/" + rig;
  if (query == CalibrationQuery()) return name;
  return fmt::format("{}?{}/{}/{}/{}/{}/{}",
                     name,
                     NumberText(query.state),
                     NumberText(query.verdict),
                     RangeText(query.create_time_ns),
                     RangeText(query.temperature_c),
                     static_cast<int>(query.order),
                     query.descending);
}

// The versions of a rig are created in the order of their numbers. Those of all
// rigs are sorted by steady time, and by what the query names if it has
// conditions: the indexes for these begin with what they compare.
RowOrder CalibrationOrder(const std::string& rig,
                          const CalibrationQuery& query) {
  RowOrder order{
      .columns = {}, .is_real = false, .descending = query.descending};
  if (query.order == CalibrationQuery::Order::kTemperature) {
    order.columns.emplace_back("c.temperature_c");
    order.is_real = true;
  } else if (rig.empty()) {
    order.columns.emplace_back(query == CalibrationQuery()
                                   ? "c.create_steady_ns"
                                   : "c.create_time_ns");
  }
  if (rig.empty()) order.columns.emplace_back("c.rig");
  order.columns.emplace_back("c.version");
  return order;
}

void AndCalibrationQuery(const CalibrationQuery& query, SqlCondition* to) {
  AndIs("c.state", query.state, to);
  AndIs("c.verdict", query.verdict, to);
  AndRange("c.create_time_ns", query.create_time_ns, to);
  AndRange("c.temperature_c", query.temperature_c, to);
  // The condition of the index.
  if (query.order == CalibrationQuery::Order::kTemperature) {
    to->And("c.temperature_c IS NOT NULL");
  }
}

// A page of keys of versions: their content is read only once the page is
// known, so that nothing sorts it.
absl::StatusOr<Listed<VersionKey>> FindVersions(Connection* db,
                                                const std::string& rig,
                                                const CalibrationQuery& query,
                                                const Page& page,
                                                const RigQuery& of) {
  const std::string list = CalibrationListName(rig, query, of);
  const RowOrder order = CalibrationOrder(rig, query);
  SELFCAL_ASSIGN_OR_RETURN(const RowPlace place, RowPlaceOf(list, order, page));
  SqlCondition condition;
  if (!rig.empty()) {
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
    condition.And("c.rig = " + condition.Parameter(rig_id));
  }
  AndCalibrationQuery(query, &condition);
  AndAfter(order, place, &condition);
  SqlCondition of_rigs = condition.Next();
  if (rig.empty()) AddRigConditions(of, "g", &of_rigs);
  const bool some_rigs = !of_rigs.is_empty();
  if (some_rigs) condition.And(of_rigs);
  const int size = PageSize(page);
  const std::string limit = condition.Parameter(std::int64_t{size + 1});
  Statement read(db,
                 condition.reuse(),
                 fmt::format("SELECT c.rig, c.version, {} "
                             "FROM calibrations c JOIN rigs g ON g.rig = c.rig "
                             "WHERE {} ORDER BY {} LIMIT {}",
                             fmt::join(order.columns, ", "),
                             condition.sql(),
                             OrderText(order),
                             limit));
  condition.Bind(&read);
  Listed<VersionKey> found;
  SELFCAL_ASSIGN_OR_RETURN(
      found.next_token,
      ReadPage(list, order, 2, size, &read, [&](const Statement& row) {
        found.items.emplace_back(row.Int(0), row.Int(1));
      }));
  return found;
}

// The records of the versions, or the reason why one cannot be read.
absl::StatusOr<std::map<VersionKey, absl::StatusOr<StoredCalibration>>>
ReadVersions(Connection* db,
             const std::vector<VersionKey>& keys,
             CalibrationParser parse) {
  std::map<VersionKey, absl::StatusOr<StoredCalibration>> versions;
  if (keys.empty()) return versions;
  std::vector<std::vector<SqlCondition::Value>> rows;
  for (const auto& [rig, version] : keys) rows.push_back({rig, version});
  SqlCondition condition;
  condition.AndIn("(c.rig, c.version)", rows);
  Statement read(
      db, condition.reuse(), SelectCalibrations() + "WHERE " + condition.sql());
  condition.Bind(&read);
  while (read.Next()) {
    versions.emplace(VersionKey(read.Int(11), read.Int(0)),
                     CalibrationFromRow(read, parse));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return versions;
}

}  // namespace

// A version whose record is damaged is left out of a list of all rigs, as it
// must not hide those of the others.
absl::StatusOr<Listed<StoredCalibration>> ListCalibrationRows(
    Connection* db,
    const std::string& rig,
    const CalibrationQuery& query,
    const Page& page,
    const RigQuery& of,
    CalibrationParts parts) {
  SELFCAL_ASSIGN_OR_RETURN(const Listed<VersionKey> found,
                           FindVersions(db, rig, query, page, of));
  SELFCAL_ASSIGN_OR_RETURN(
      auto versions,
      ReadVersions(
          db,
          found.items,
          parts == CalibrationParts::kAll ? ParseWithoutSteps : ParseSummary));
  Listed<StoredCalibration> listed;
  listed.next_token = found.next_token;
  for (const VersionKey& key : found.items) {
    const auto version = versions.find(key);
    // A rig may be deleted meanwhile.
    if (version == versions.end()) continue;
    const absl::Status& status = version->second.status();
    if (rig.empty() && absl::IsDataLoss(status)) continue;
    SELFCAL_RETURN_IF_ERROR(status);
    listed.items.push_back(*std::move(version->second));
  }
  SELFCAL_RETURN_IF_ERROR(ReadOrigins(db, &listed.items));
  return listed;
}

absl::StatusOr<std::vector<StoredCalibration>> ReadReports(
    Connection* db, const std::vector<VersionId>& versions) {
  std::vector<StoredCalibration> reports;
  if (versions.empty()) return reports;
  std::vector<std::vector<SqlCondition::Value>> ids;
  for (const auto& [rig, version] : versions) ids.push_back({rig, version});
  SqlCondition condition;
  condition.AndIn("(g.id, c.version)", ids);
  Statement read(db,
                 condition.reuse(),
                 "SELECT c.version, g.id, c.content, c.sha256 "
                 "FROM calibrations c JOIN rigs g ON g.rig = c.rig WHERE " +
                     condition.sql());
  condition.Bind(&read);
  while (read.Next()) {
    auto report = ParseContent(read, 2, read.Text(1), read.Int(0), ParseReport);
    if (absl::IsDataLoss(report.status())) continue;
    SELFCAL_RETURN_IF_ERROR(report.status());
    reports.push_back(*std::move(report));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return reports;
}

absl::StatusOr<std::vector<VersionId>> IncompleteVersions(Connection* db,
                                                          int limit) {
  Statement read(db,
                 "SELECT g.id, c.version FROM calibrations c "
                 "JOIN rigs g ON g.rig = c.rig "
                 "WHERE c.validated IS NULL AND c.state <> 4 "
                 "ORDER BY c.rig, c.version LIMIT ?1",
                 limit);
  std::vector<VersionId> versions;
  while (read.Next()) versions.emplace_back(read.Text(0), read.Int(1));
  SELFCAL_RETURN_IF_ERROR(read.status());
  return versions;
}

}  // namespace selfcal::server
