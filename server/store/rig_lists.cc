#include "server/store/rig_lists.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/changed_since.h"
#include "server/store/paging.h"
#include "server/store/rigs.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// A rig of the page, with its row.
struct Found {
  std::int64_t rowid = 0;
  std::int64_t place = 0;  // Place::value
  RigSummary summary;
};

// The position after which a page begins.
struct Place {
  std::int64_t value = 0;  // of the column that the list is sorted by
  std::string id;
};

// The column that a list is sorted by, before the name; empty: by name alone.
std::string ColumnOf(RigQuery::Order order) {
  switch (order) {
    case RigQuery::Order::kName:
      return "";
    case RigQuery::Order::kLastSeen:
      return "last_seen_ns";
    case RigQuery::Order::kAlarms:
      return "alarms";
  }
  return "";
}

// On a row n of rig_name_suffixes: a name contains the text if one of its
// suffixes begins with it. No character of a name is as large as the last one
// of the bound.
void AddTextCondition(const std::string& text, SqlCondition* condition) {
  condition->And("n.suffix >= " + condition->Parameter(text));
  condition->And("n.suffix < " + condition->Parameter(text + '\x7f'));
}

std::string ListOf(const RigQuery& query) {
  return fmt::format("rigs by {}{} with {}",
                     ColumnOf(query.order),
                     query.descending ? " desc" : "",
                     FilterText(query));
}

std::string KeyOf(const Found& found) {
  return fmt::format("{} {}", found.place, found.summary.rig);
}

// The position before the first rig.
Place Beginning(const RigQuery& query) {
  if (!query.descending) return {-1, ""};
  return {std::numeric_limits<std::int64_t>::max(), "~"};
}

absl::StatusOr<Place> PlaceOf(const RigQuery& query, const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto key, PageKey(ListOf(query), page));
  if (!key) return Beginning(query);
  Place place;
  const char* end = key->data() + key->size();
  const auto [rest, error] = std::from_chars(key->data(), end, place.value);
  if (error != std::errc() || rest == end || *rest != ' ') {
    return absl::InvalidArgumentError(
        "the page token is not one of this list; ask for the first page");
  }
  place.id.assign(rest + 1, end);
  return place;
}

// Up to this number of names with a text, all of them are read and sorted.
constexpr std::int64_t kFewNames = 2000;

// Returns true if the text of the query is in few names.
absl::StatusOr<bool> FindsFewNames(Connection* db, const RigQuery& query) {
  if (query.text.empty()) return false;
  SqlCondition condition;
  AddTextCondition(query.text, &condition);
  Statement read(
      db,
      condition.reuse(),
      fmt::format("SELECT count(*) FROM (SELECT 1 "
                  "FROM rig_name_suffixes n WHERE {} LIMIT {}) AS few",
                  condition.sql(),
                  kFewNames + 1));
  condition.Bind(&read);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  return found && read.Int(0) <= kFewNames;
}

// `of_few`: few rigs meet the condition. No index has the expression that they
// are then sorted by: planners would read the rigs in the order of one, to find
// those few among them.
std::string SqlOf(const RigQuery& query,
                  const SqlCondition& condition,
                  bool of_few) {
  const std::string column = ColumnOf(query.order);
  const bool by_name = column.empty();
  const char* direction = query.descending ? "DESC" : "ASC";
  const char* beyond = query.descending ? "<" : ">";
  const std::string place =
      by_name ? fmt::format("id {} ?2", beyond)
              : fmt::format("({}, id) {} (?1, ?2)", column, beyond);
  const std::string order =
      by_name
          ? fmt::format("id{} {}", of_few ? " || ''" : "", direction)
          : fmt::format(
                "{0}{2} {1}, id {1}", column, direction, of_few ? " + 0" : "");
  // The condition on the name does not use ?1, so it is used here.
  return fmt::format(
      "SELECT rig, id, create_time_ns, last_seen_ns, {} FROM rigs "
      "WHERE {} AND CAST(?1 AS BIGINT) IS NOT NULL AND {} "
      "ORDER BY {} LIMIT ?3",
      by_name ? "last_seen_ns" : column,
      place,
      condition.sql(),
      order);
}

absl::StatusOr<std::vector<Found>> FindRigs(Connection* db,
                                            const RigQuery& query,
                                            const Place& place,
                                            int limit) {
  SELFCAL_ASSIGN_OR_RETURN(const bool of_few, FindsFewNames(db, query));
  SqlCondition condition(4);
  AddRigConditions(query, "rigs", &condition);
  Statement read(db,
                 condition.reuse(),
                 SqlOf(query, condition, of_few),
                 place.value,
                 place.id,
                 limit);
  condition.Bind(&read);
  std::vector<Found> found;
  while (read.Next()) {
    Found rig;
    rig.rowid = read.Int(0);
    rig.summary.rig = read.Text(1);
    rig.summary.create_time_ns = read.Int(2);
    rig.summary.last_seen_ns = read.Int(3);
    rig.place = read.Int(4);
    found.push_back(std::move(rig));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return found;
}

// The summaries of some rigs, by the keys of these.
using Summaries = std::map<std::int64_t, RigSummary*>;

std::vector<std::int64_t> KeysOf(const Summaries& summaries) {
  std::vector<std::int64_t> keys;
  for (const auto& [rig, summary] : summaries) keys.push_back(rig);
  return keys;
}

// Passes the rows of `sql` of the rigs, whose first column is
// the key of one, with the summary of that. `sql` names the table with this key
// g, and has no condition.
template <typename Take>
absl::Status ReadEach(Connection* db,
                      const Summaries& summaries,
                      const std::string& sql,
                      const Take& take) {
  SqlCondition condition;
  condition.AndOneOf("g.rig", KeysOf(summaries));
  Statement read(db, condition.reuse(), sql + " WHERE " + condition.sql());
  condition.Bind(&read);
  while (read.Next()) take(read, summaries.at(read.Int(0)));
  return read.status();
}

// Versions, newest run, change, and whether it is an outlier.
absl::Status ReadNewest(Connection* db, const Summaries& summaries) {
  return ReadEach(
      db,
      summaries,
      fmt::format(
          "SELECT g.rig, c.version, (SELECT a.time_ns FROM activations a "
          "    WHERE a.rig = c.rig AND a.version = c.version "
          "    ORDER BY a.activation DESC LIMIT 1), "
          "  n.version, n.state, r.run, r.state, "
          "  (SELECT d.time_ns FROM changes d WHERE d.rig = g.rig "
          "   ORDER BY d.change DESC LIMIT 1), "
          "  (SELECT o.version FROM cohort_outliers o WHERE o.rig = g.rig), {} "
          "FROM rigs g "
          "LEFT JOIN calibrations c ON c.rig = g.rig AND c.state = 1 "
          "LEFT JOIN calibrations n ON n.rig = g.rig AND n.version = "
          "  (SELECT max(version) FROM calibrations m WHERE m.rig = g.rig) "
          "LEFT JOIN runs r ON r.rig = g.rig AND r.run = "
          "  (SELECT max(run) FROM runs m WHERE m.rig = g.rig)",
          kChangedSince),
      [](const Statement& row, RigSummary* summary) {
        summary->active_version = row.Int(1);
        summary->active_since_ns = row.Int(2);
        if (!row.IsNull(3)) {
          summary->newest_version = row.Int(3);
          summary->newest_state = static_cast<CalibrationState>(row.Int(4));
        }
        if (!row.IsNull(5)) {
          summary->newest_run = row.Int(5);
          summary->run_state = static_cast<RunState>(row.Int(6));
        }
        summary->newest_change_ns = row.Int(7);
        summary->unlike_cohort = row.Int(8);
        summary->changed_since = row.Int(9);
      });
}

absl::Status ReadLabels(Connection* db, const Summaries& summaries) {
  return ReadEach(db,
                  summaries,
                  "SELECT g.rig, g.name, g.value FROM rig_labels g",
                  [](const Statement& row, RigSummary* summary) {
                    summary->labels[row.Text(1)] = row.Text(2);
                  });
}

// The progress of the reports, on a device.
absl::Status ReadUplinks(Connection* db, const Summaries& summaries) {
  return ReadEach(db,
                  summaries,
                  "SELECT g.rig, g.time_ns, (SELECT count(*) FROM outbox o "
                  "  WHERE o.rig = g.rig) FROM uplinks g",
                  [](const Statement& row, RigSummary* summary) {
                    summary->uplink = {row.Int(1), row.Int(2), ""};
                  });
}

// The device that reports the rig, at a hub.
absl::Status ReadDevices(Connection* db, const Summaries& summaries) {
  return ReadEach(db,
                  summaries,
                  "SELECT g.rig, g.time_ns, g.waiting, g.program_version "
                  "FROM reported_rigs g",
                  [](const Statement& row, RigSummary* summary) {
                    summary->device = {row.Int(1), row.Int(2), row.Text(3)};
                  });
}

// The state on which alarms depend.
absl::Status ReadState(Connection* db, const Summaries& summaries) {
  SELFCAL_RETURN_IF_ERROR(ReadNewest(db, summaries));
  SELFCAL_RETURN_IF_ERROR(ReadDevices(db, summaries));
  SELFCAL_ASSIGN_OR_RETURN(auto tables, ReadTables(db, KeysOf(summaries)));
  for (auto& [rig, of_rig] : tables) {
    summaries.at(rig)->tables = std::move(of_rig);
  }
  return absl::OkStatus();
}

// A page of rigs.
absl::StatusOr<Listed<Found>> ListFound(Connection* db,
                                        const RigQuery& query,
                                        const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const Place place, PlaceOf(query, page));
  const std::size_t size = PageSize(page);
  Listed<Found> listed;
  SELFCAL_ASSIGN_OR_RETURN(
      listed.items, FindRigs(db, query, place, static_cast<int>(size) + 1));
  if (listed.items.size() > size) {
    listed.items.pop_back();
    listed.next_token =
        MakePageToken(ListOf(query), KeyOf(listed.items.back()));
  }
  return listed;
}

}  // namespace

void AddRigConditions(const RigQuery& query,
                      const std::string& rigs,
                      SqlCondition* condition,
                      const std::string& from) {
  const auto with_any = [&](const auto& labels) {
    std::vector<std::string> any;
    for (const auto& [name, value] : labels) {
      const std::string parameter = condition->Parameter(name);
      any.push_back(fmt::format("(l.name = {} AND l.value = {})",
                                parameter,
                                condition->Parameter(value)));
    }
    return fmt::format("SELECT l.rig FROM rig_labels l WHERE ({}){}",
                       fmt::join(any, " OR "),
                       from.empty() ? "" : " AND l.rig >= " + from);
  };
  if (!query.text.empty()) {
    SqlCondition names = condition->Next();
    AddTextCondition(query.text, &names);
    condition->AndWithin(
        rigs + ".rig IN (SELECT n.rig FROM rig_name_suffixes n WHERE ",
        names,
        ")");
  }
  const auto is_one_of = [&](const std::string& keys) {
    condition->And(fmt::format("{}.rig IN ({})", rigs, keys));
  };
  if (!query.name.empty()) {
    condition->And(rigs + ".id = " + condition->Parameter(query.name));
  }
  for (const auto& label : query.labels) {
    is_one_of(with_any(std::vector{label}));
  }
  if (query.with_alarms) condition->And(rigs + ".alarms > 0");
  if (query.choice) {
    // One set of keys: with alternatives on the row itself, planners would read
    // all rigs to find those few.
    std::vector<std::string> chosen;
    for (const std::string& name : query.choice->names) {
      chosen.push_back("SELECT c.rig FROM rigs c WHERE c.id = " +
                       condition->Parameter(name));
    }
    if (!query.choice->labels.empty()) {
      chosen.push_back(with_any(query.choice->labels));
    }
    if (chosen.empty()) {
      condition->And("FALSE");
    } else {
      is_one_of(fmt::format("{}", fmt::join(chosen, " UNION ALL ")));
    }
  }
}

// Names and values of labels have no line feeds.
std::string FilterText(const RigQuery& query) {
  std::string text = query.text + "\n";
  for (const auto& [name, value] : query.labels) {
    text += name + "=" + value + "\n";
  }
  return text + query.name + (query.with_alarms ? " and alarms" : "");
}

absl::StatusOr<Listed<RigSummary>> ListSummaryRows(Connection* db,
                                                   const RigQuery& query,
                                                   const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(Listed<Found> found, ListFound(db, query, page));
  Listed<RigSummary> listed;
  listed.next_token = found.next_token;
  if (found.items.empty()) return listed;
  Summaries summaries;
  for (Found& rig : found.items) summaries[rig.rowid] = &rig.summary;
  SELFCAL_RETURN_IF_ERROR(ReadLabels(db, summaries));
  SELFCAL_RETURN_IF_ERROR(ReadUplinks(db, summaries));
  SELFCAL_RETURN_IF_ERROR(ReadState(db, summaries));
  for (Found& rig : found.items) {
    listed.items.push_back(std::move(rig.summary));
  }
  return listed;
}

absl::StatusOr<RigSummary> ReadRigState(UnitOfWork* tx) {
  RigSummary summary;
  summary.rig = tx->rig();
  SELFCAL_RETURN_IF_ERROR(ReadState(tx->db(), {{tx->rig_row(), &summary}}));
  return summary;
}

absl::StatusOr<Listed<StoredRig>> ListRigRows(Connection* db,
                                              const RigQuery& query,
                                              const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const Listed<Found> found,
                           ListFound(db, query, page));
  std::set<std::string> names;
  for (const Found& rig : found.items) names.insert(rig.summary.rig);
  SELFCAL_ASSIGN_OR_RETURN(auto rigs, ReadRigs(db, names));
  Listed<StoredRig> listed;
  listed.next_token = found.next_token;
  for (const Found& rig : found.items) {
    listed.items.push_back(std::move(rigs.at(rig.summary.rig)));
  }
  return listed;
}

}  // namespace selfcal::server
