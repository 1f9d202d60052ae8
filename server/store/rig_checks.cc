#include "server/store/rig_checks.h"

#include <fmt/format.h>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"

namespace selfcal::server {
namespace {

const char* ColumnOf(RigCheck check) {
  switch (check) {
    case RigCheck::kSession:
      return "session_check_ns";
    case RigCheck::kTime:
      return "time_check_ns";
    case RigCheck::kScores:
      return "score_check_ns";
  }
  return "";
}

}  // namespace

absl::StatusOr<std::vector<std::string>> RigsToCheck(Connection* db,
                                                     RigCheck check,
                                                     std::int64_t until_ns,
                                                     int limit) {
  Statement read(db,
                 fmt::format("SELECT id FROM rigs WHERE {0} <= ?1 "
                             "ORDER BY {0} LIMIT ?2",
                             ColumnOf(check)),
                 until_ns,
                 limit);
  std::vector<std::string> names;
  while (read.Next()) names.push_back(read.Text(0));
  SELFCAL_RETURN_IF_ERROR(read.status());
  return names;
}

absl::StatusOr<std::optional<std::int64_t>> NextCheck(UnitOfWork* tx,
                                                      RigCheck check) {
  Statement read(
      tx->db(),
      fmt::format("SELECT {} FROM rigs WHERE rig = ?1", ColumnOf(check)),
      tx->rig_row());
  std::optional<std::int64_t> next_ns;
  if (read.Next() && !read.IsNull(0)) next_ns = read.Int(0);
  SELFCAL_RETURN_IF_ERROR(read.status());
  return next_ns;
}

absl::Status SetCheck(UnitOfWork* tx,
                      RigCheck check,
                      std::optional<std::int64_t> next_ns) {
  return Statement(tx->db(),
                   fmt::format("UPDATE rigs SET {} = ?2 WHERE rig = ?1",
                               ColumnOf(check)),
                   tx->rig_row(),
                   next_ns)
      .Run();
}

absl::Status RequestChecks(UnitOfWork* tx, std::int64_t time_ns) {
  return Statement(
             tx->db(),
             "UPDATE rigs SET "
             "  session_check_ns = CASE WHEN session_check_ns = ?2 "
             "    THEN coalesce((SELECT s.steady_ns FROM segments s "
             "      WHERE s.rig = ?1 ORDER BY s.sequence DESC LIMIT 1), 0) "
             "    ELSE session_check_ns END, "
             "  time_check_ns = CASE WHEN time_check_ns > ?3 "
             "    THEN ?3 ELSE time_check_ns END "
             "WHERE rig = ?1 "
             "  AND (session_check_ns = ?2 OR time_check_ns > ?3)",
             tx->rig_row(),
             kNoCheck,
             time_ns)
      .Run();
}

}  // namespace selfcal::server
