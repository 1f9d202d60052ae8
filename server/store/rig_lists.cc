#include "server/store/rig_lists.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"
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

std::string SqlOf(const RigQuery& query, const SqlCondition& condition) {
  const std::string column = ColumnOf(query.order);
  const bool by_name = column.empty();
  const char* direction = query.descending ? "DESC" : "ASC";
  const char* beyond = query.descending ? "<" : ">";
  const std::string place =
      by_name ? fmt::format("id {} ?2", beyond)
              : fmt::format("({}, id) {} (?1, ?2)", column, beyond);
  const std::string order =
      by_name ? fmt::format("id {}", direction)
              : fmt::format("{0} {1}, id {1}", column, direction);
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
  SqlCondition condition(4);
  AddRigConditions(query, "rigs", &condition);
  Statement read(db,
                 condition.reuse(),
                 SqlOf(query, condition),
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

// Versions, newest run, change, and whether it is an outlier: one statement, as
// a list of rigs asks for each of them.
absl::Status ReadNewest(Connection* db, std::int64_t rig, RigSummary* summary) {
  Statement read(
      db,
      "SELECT c.version, (SELECT a.time_ns FROM activations a "
      "    WHERE a.rig = c.rig AND a.version = c.version "
      "    ORDER BY a.activation DESC LIMIT 1), "
      "  n.version, n.state, r.run, r.state, "
      "  (SELECT d.time_ns FROM changes d WHERE d.rig = g.rig "
      "   ORDER BY d.change DESC LIMIT 1), "
      "  (SELECT o.version FROM cohort_outliers o WHERE o.rig = g.rig) "
      "FROM rigs g "
      "LEFT JOIN calibrations c ON c.rig = g.rig AND c.state = 1 "
      "LEFT JOIN calibrations n ON n.rig = g.rig AND n.version = "
      "  (SELECT max(version) FROM calibrations WHERE rig = ?1) "
      "LEFT JOIN runs r ON r.rig = g.rig AND r.run = "
      "  (SELECT max(run) FROM runs WHERE rig = ?1) "
      "WHERE g.rig = ?1",
      rig);
  if (read.Next()) {
    summary->active_version = read.Int(0);
    summary->active_since_ns = read.Int(1);
    if (!read.IsNull(2)) {
      summary->newest_version = read.Int(2);
      summary->newest_state = static_cast<CalibrationState>(read.Int(3) - 1);
    }
    if (!read.IsNull(4)) {
      summary->newest_run = read.Int(4);
      summary->run_state = static_cast<RunState>(read.Int(5) - 1);
    }
    summary->newest_change_ns = read.Int(6);
    summary->unlike_cohort = read.Int(7);
  }
  return read.status();
}

absl::Status ReadLabels(Connection* db, std::int64_t rig, RigSummary* summary) {
  Statement read(db, "SELECT name, value FROM rig_labels WHERE rig = ?1", rig);
  while (read.Next()) summary->labels[read.Text(0)] = read.Text(1);
  return read.status();
}

// The progress of the reports, on a device.
absl::Status ReadUplink(Connection* db, std::int64_t rig, RigSummary* summary) {
  Statement read(db,
                 "SELECT time_ns, (SELECT count(*) FROM outbox o "
                 "  WHERE o.rig = u.rig) FROM uplinks u WHERE rig = ?1",
                 rig);
  if (read.Next()) summary->uplink = {read.Int(0), read.Int(1), ""};
  return read.status();
}

// The device that reports the rig, at a hub.
absl::Status ReadDevice(Connection* db, std::int64_t rig, RigSummary* summary) {
  Statement read(db,
                 "SELECT time_ns, waiting, program_version "
                 "FROM reported_rigs WHERE rig = ?1",
                 rig);
  if (read.Next()) {
    summary->device = {read.Int(0), read.Int(1), read.Text(2)};
  }
  return read.status();
}

// The state on which alarms depend.
absl::Status ReadState(Connection* db, std::int64_t rig, RigSummary* summary) {
  SELFCAL_RETURN_IF_ERROR(ReadNewest(db, rig, summary));
  SELFCAL_ASSIGN_OR_RETURN(summary->tables, ReadTables(db, rig));
  return ReadDevice(db, rig, summary);
}

absl::Status ReadRest(Connection* db, std::int64_t rig, RigSummary* summary) {
  SELFCAL_RETURN_IF_ERROR(ReadLabels(db, rig, summary));
  SELFCAL_RETURN_IF_ERROR(ReadUplink(db, rig, summary));
  return ReadState(db, rig, summary);
}

// A page of what `read` makes of each rig that is found.
template <typename Item, typename Read>
absl::StatusOr<Listed<Item>> ListFound(Connection* db,
                                       const RigQuery& query,
                                       const Page& page,
                                       const Read& read) {
  SELFCAL_ASSIGN_OR_RETURN(const Place place, PlaceOf(query, page));
  const int size = PageSize(page);
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Found> found,
                           FindRigs(db, query, place, size + 1));
  Listed<Item> listed;
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (static_cast<int>(k) == size) {
      listed.next_token = MakePageToken(ListOf(query), KeyOf(found[k - 1]));
      break;
    }
    SELFCAL_ASSIGN_OR_RETURN(Item item, read(found[k]));
    listed.items.push_back(std::move(item));
  }
  return listed;
}

}  // namespace

void AddRigConditions(const RigQuery& query,
                      const std::string& rigs,
                      SqlCondition* condition) {
  const auto has_label = [&](const auto& label) {
    const std::string name = condition->Parameter(label.first);
    return fmt::format(
        "{}.rig IN (SELECT l.rig FROM rig_labels l "
        "  WHERE l.name = {} AND l.value = {})",
        rigs,
        name,
        condition->Parameter(label.second));
  };
  const auto has_name = [&](const std::string& name) {
    return fmt::format("{}.id = {}", rigs, condition->Parameter(name));
  };
  if (!query.text.empty()) {
    // A text contains another if it changes when that is removed.
    condition->And(fmt::format("replace({0}.id, {1}, '') <> {0}.id",
                               rigs,
                               condition->Parameter(query.text)));
  }
  if (!query.name.empty()) condition->And(has_name(query.name));
  for (const auto& label : query.labels) condition->And(has_label(label));
  if (query.with_alarms) condition->And(rigs + ".alarms > 0");
  if (query.choice) {
    std::vector<std::string> any = {"FALSE"};
    for (const std::string& name : query.choice->names) {
      any.push_back(has_name(name));
    }
    for (const auto& label : query.choice->labels) {
      any.push_back(has_label(label));
    }
    condition->And(fmt::format("({})", fmt::join(any, " OR ")));
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
  return ListFound<RigSummary>(
      db, query, page, [db](const Found& found) -> absl::StatusOr<RigSummary> {
        RigSummary summary = found.summary;
        SELFCAL_RETURN_IF_ERROR(ReadRest(db, found.rowid, &summary));
        return summary;
      });
}

absl::StatusOr<RigSummary> ReadRigState(UnitOfWork* tx) {
  RigSummary summary;
  summary.rig = tx->rig();
  SELFCAL_RETURN_IF_ERROR(ReadState(tx->db(), tx->rig_row(), &summary));
  return summary;
}

absl::StatusOr<Listed<StoredRig>> ListRigRows(Connection* db,
                                              const RigQuery& query,
                                              const Page& page) {
  return ListFound<StoredRig>(db, query, page, [db](const Found& found) {
    return ReadRig(db, found.summary.rig);
  });
}

}  // namespace selfcal::server
