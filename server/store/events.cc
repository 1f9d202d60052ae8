#include "server/store/events.h"

#include <fmt/format.h>

#include <charconv>
#include <limits>
#include <string_view>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/paging.h"
#include "server/store/rig_lists.h"

namespace selfcal::server {
namespace {

constexpr std::string_view kEventColumns =
    "SELECT event, time_ns, rig, kind, detail, steady_ns FROM events";

// The events of all rigs are in this order.
struct EventPlace {
  std::int64_t steady_ns = 0;
  std::string rig;
  std::int64_t event = 0;
};

using Limits = std::numeric_limits<std::int64_t>;

// The beginning of the list of all rigs.
EventPlace Beginning(bool newest_first) {
  return {newest_first ? Limits::max() : Limits::min(), "", 0};
}

std::string PlaceText(const StoredEvent& event) {
  return fmt::format("{} {} {}", event.steady_ns, event.event, event.rig);
}

// The place after which a page begins.
absl::StatusOr<EventPlace> PlaceOfPage(const std::string& list,
                                       const Page& page,
                                       bool newest_first) {
  SELFCAL_ASSIGN_OR_RETURN(const auto text, PageKey(list, page));
  if (!text) return Beginning(newest_first);
  EventPlace place;
  const char* const end = text->data() + text->size();
  const auto steady = std::from_chars(text->data(), end, place.steady_ns);
  if (steady.ec == std::errc() && steady.ptr != end && *steady.ptr == ' ') {
    const auto event = std::from_chars(steady.ptr + 1, end, place.event);
    if (event.ec == std::errc() && event.ptr != end && *event.ptr == ' ') {
      place.rig.assign(event.ptr + 1, end);
      return place;
    }
  }
  return BadPageToken();
}

// Reads one event beyond the page, if there is one.
absl::StatusOr<Listed<StoredEvent>> ReadEvents(Statement* read) {
  Listed<StoredEvent> listed;
  while (read->Next()) {
    listed.items.push_back({read->Int(0),
                            read->Int(1),
                            read->Text(2),
                            static_cast<EventKind>(read->Int(3)),
                            read->Text(4),
                            read->Int(5)});
  }
  SELFCAL_RETURN_IF_ERROR(read->status());
  return listed;
}

absl::StatusOr<Listed<StoredEvent>> ListOfMany(Connection* db,
                                               const Page& page,
                                               const RigQuery& of,
                                               bool newest_first) {
  SqlCondition condition(5);
  AddRigConditions(of, "r", &condition);
  const std::string list =
      (newest_first ? "newest-events of many " : "events of many ") +
      FilterText(of);
  SELFCAL_ASSIGN_OR_RETURN(const EventPlace place,
                           PlaceOfPage(list, page, newest_first));
  const int size = PageSize(page);
  Statement read(
      db,
      condition.reuse(),
      fmt::format("{0} e WHERE (steady_ns, rig, event) {1} (?1, ?2, ?3) {3}"
                  "ORDER BY steady_ns {2}, rig {2}, event {2} LIMIT ?4",
                  kEventColumns,
                  newest_first ? "<" : ">",
                  newest_first ? "DESC" : "ASC",
                  condition.is_empty()
                      ? ""
                      : "AND EXISTS (SELECT 1 FROM rigs r "
                        "  WHERE r.id = e.rig "
                        "  AND e.event > r.earlier_events AND " +
                            condition.sql() + ") "),
      place.steady_ns,
      place.rig,
      place.event,
      size + 1);
  condition.Bind(&read);
  SELFCAL_ASSIGN_OR_RETURN(auto listed, ReadEvents(&read));
  CutPage(list, size, PlaceText, &listed);
  return listed;
}

absl::StatusOr<Listed<StoredEvent>> ListOfRig(Connection* db,
                                              const Page& page,
                                              const std::string& rig,
                                              bool with_earlier,
                                              bool newest_first) {
  const std::string list = (newest_first ? "newest-events/" : "events/") + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto number, PageNumber(list, page));
  const int size = PageSize(page);
  Statement read(
      db,
      fmt::format("{} WHERE rig = ?1 AND event {} ?2 {}ORDER BY event {} "
                  "LIMIT ?3",
                  kEventColumns,
                  newest_first ? "<" : ">",
                  with_earlier ? ""
                               : "AND event > (SELECT r.earlier_events "
                                 "  FROM rigs r WHERE r.id = ?1) ",
                  newest_first ? "DESC" : "ASC"),
      rig,
      number.value_or(newest_first ? Limits::max() : 0),
      size + 1);
  SELFCAL_ASSIGN_OR_RETURN(auto listed, ReadEvents(&read));
  CutPage(
      list,
      size,
      [](const StoredEvent& event) { return event.event; },
      &listed);
  return listed;
}

}  // namespace

absl::Status AppendEvent(UnitOfWork* tx,
                         EventKind kind,
                         const std::string& detail) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t number,
      InsertEvent(
          tx->db(),
          {0, tx->time_ns(), tx->rig(), kind, detail, tx->now().steady_ns}));
  tx->Changed(RecordKind::kEvent, number);
  return absl::OkStatus();
}

absl::StatusOr<std::int64_t> InsertEvent(Connection* db,
                                         const StoredEvent& event) {
  for (;;) {
    SELFCAL_ASSIGN_OR_RETURN(
        const std::int64_t number,
        InsertReturning(db,
                        "INSERT INTO events (rig, event, time_ns, steady_ns, "
                        "  kind, detail) VALUES (?1, "
                        "  (SELECT coalesce(max(event), 0) + 1 FROM events "
                        "   WHERE rig = ?1), ?2, ?3, ?4, ?5) "
                        "ON CONFLICT DO NOTHING RETURNING event",
                        event.rig,
                        event.time_ns,
                        event.steady_ns,
                        static_cast<int>(event.kind),
                        event.detail));
    if (number != 0) return number;
    // No lock protects the numbers of the daemon's events: another one has
    // committed an event with this number since the statement began.
  }
}

absl::Status InsertReportedEvent(UnitOfWork* tx, const StoredEvent& event) {
  const int kind = static_cast<int>(event.kind);
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t inserted,
      InsertReturning(tx->db(),
                      "INSERT INTO events (rig, event, time_ns, steady_ns, "
                      "  kind, detail) "
                      "SELECT id, ?2, ?3, ?4, ?5, ?6 FROM rigs "
                      "WHERE rig = ?1 AND earlier_events < ?2 "
                      "ON CONFLICT DO NOTHING RETURNING event",
                      tx->rig_row(),
                      event.event,
                      event.time_ns,
                      event.steady_ns,
                      kind,
                      event.detail));
  if (inserted != 0) return absl::OkStatus();
  Statement read(tx->db(),
                 "SELECT 1 FROM events e JOIN rigs r ON r.id = e.rig "
                 "WHERE r.rig = ?1 AND e.event > r.earlier_events "
                 "AND e.time_ns = ?2 AND e.steady_ns = ?3 AND e.kind = ?4 "
                 "AND e.detail = ?5 LIMIT 1",
                 tx->rig_row(),
                 event.time_ns,
                 event.steady_ns,
                 kind,
                 event.detail);
  const bool is_there = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (is_there) return absl::OkStatus();
  return InsertEvent(tx->db(), event).status();
}

absl::StatusOr<Listed<StoredEvent>> ListEventRows(Connection* db,
                                                  const Page& page,
                                                  const std::string& rig,
                                                  const RigQuery& of) {
  return rig.empty() ? ListOfMany(db, page, of, false)
                     : ListOfRig(db, page, rig, !of.choice, false);
}

absl::StatusOr<Listed<StoredEvent>> ListNewestEventRows(Connection* db,
                                                        const Page& page,
                                                        const std::string& rig,
                                                        const RigQuery& of) {
  return rig.empty() ? ListOfMany(db, page, of, true)
                     : ListOfRig(db, page, rig, !of.choice, true);
}

}  // namespace selfcal::server
