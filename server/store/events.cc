#include "server/store/events.h"

#include "server/store/clock.h"
#include "server/store/paging.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
absl::Status AppendEvent(Connection* db,
                         const std::string& rig,
                         EventKind kind,
                         const std::string& detail) {
  return Statement(db,
                   "INSERT INTO events (time_ns, rig, kind, detail) "
                   "VALUES (?1, ?2, ?3, ?4)",
                   NowNs(),
                   rig,
                   static_cast<int>(kind) + 1,
                   detail)
      .Run();
}

absl::StatusOr<Listed<StoredEvent>> ListEventRows(Connection* db,
                                                  const Page& page,
                                                  const std::string& rig) {
  const std::string list = rig.empty() ? "events" : "events/" + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto after, PageNumber(list, page));
  const int size = PageSize(page);
  Statement read(db,
                 "SELECT event, time_ns, rig, kind, detail FROM events "
                 "WHERE event > ?1 AND (?3 = '' OR rig = ?3) "
                 "ORDER BY event LIMIT ?2",
                 after.value_or(0),
                 size + 1,
                 rig);
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

}  // namespace selfcal::server
