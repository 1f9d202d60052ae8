#include "server/store/events.h"

#include <limits>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/paging.h"

namespace selfcal::server {
namespace {

// `which` is the rest of the query: ?1 is an event's number, ?2 the limit, and
// ?3 the rig, if any.
absl::StatusOr<Listed<StoredEvent>> ReadPage(Connection* db,
                                             const std::string& which,
                                             const std::string& list,
                                             std::int64_t number,
                                             const Page& page,
                                             const std::string& rig) {
  const int size = PageSize(page);
  const std::string sql =
      "SELECT event, time_ns, rig, kind, detail FROM events " + which;
  Statement read = rig.empty() ? Statement(db, sql, number, size + 1)
                               : Statement(db, sql, number, size + 1, rig);
  Listed<StoredEvent> listed;
  while (read.Next()) {
    listed.items.push_back({read.Int(0),
                            read.Int(1),
                            read.Text(2),
                            static_cast<EventKind>(read.Int(3) - 1),
                            read.Text(4)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  CutPage(
      list, size, [](const auto& e) { return e.event; }, &listed);
  return listed;
}

}  // namespace

absl::Status AppendEvent(UnitOfWork* tx,
                         EventKind kind,
                         const std::string& detail) {
  return InsertEvent(tx->db(), {0, tx->time_ns(), tx->rig(), kind, detail});
}

absl::Status InsertEvent(Connection* db, const StoredEvent& event) {
  return Statement(db,
                   "INSERT INTO events (time_ns, rig, kind, detail) "
                   "VALUES (?1, ?2, ?3, ?4)",
                   event.time_ns,
                   event.rig,
                   static_cast<int>(event.kind) + 1,
                   event.detail)
      .Run();
}

absl::StatusOr<Listed<StoredEvent>> ListEventRows(Connection* db,
                                                  const Page& page,
                                                  const std::string& rig) {
  const std::string list = rig.empty() ? "events" : "events/" + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto after, PageNumber(list, page));
  return ReadPage(db,
                  rig.empty() ? "WHERE event > ?1 ORDER BY event LIMIT ?2"
                              : "WHERE event > ?1 AND rig = ?3 "
                                "ORDER BY event LIMIT ?2",
                  list,
                  after.value_or(0),
                  page,
                  rig);
}

absl::StatusOr<Listed<StoredEvent>> ListNewestEventRows(
    Connection* db, const Page& page, const std::string& rig) {
  const std::string list =
      rig.empty() ? "newest-events" : "newest-events/" + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto before, PageNumber(list, page));
  return ReadPage(db,
                  rig.empty() ? "WHERE event < ?1 ORDER BY event DESC LIMIT ?2"
                              : "WHERE event < ?1 AND rig = ?3 "
                                "ORDER BY event DESC LIMIT ?2",
                  list,
                  before.value_or(std::numeric_limits<std::int64_t>::max()),
                  page,
                  rig);
}

}  // namespace selfcal::server
