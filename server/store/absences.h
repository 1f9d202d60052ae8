// Why tables do not hold a segment, in the database.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <fmt/format.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/clock.h"
#include "server/store/session.h"
#include "server/store/statement.h"
#include "server/store/status_macros.h"

namespace selfcal::server {

// In the order of the rig's groups. NOT_FOUND for the segment.
absl::StatusOr<std::vector<TableAbsence>> ListAbsenceRows(
    Connection* db, const std::string& rig, const SegmentKey& key);

// The rest runs inside a transaction of the caller.

// Instead of what was known of the segment and the group before.
absl::Status WriteAbsence(Connection* db,
                          std::int64_t segment,
                          const std::string& group,
                          AbsenceCause cause,
                          std::optional<std::int64_t> rival,
                          std::optional<double> rival_entropy);

// Takes entries out of their tables, and writes down why. `which` is a
// condition on the columns of table_entries; its arguments count from ?3.
template <typename... Args>
absl::Status LeaveTables(Connection* db,
                         AbsenceCause cause,
                         std::string_view which,
                         const Args&... args) {
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                fmt::format("INSERT OR REPLACE INTO table_absences "
                            "(segment, group_name, cause, time_ns) "
                            "SELECT segment, group_name, ?1, ?2 "
                            "FROM table_entries WHERE {}",
                            which),
                static_cast<int>(cause),
                NowNs(),
                args...)
          .Run());
  // ?1 and ?2 are not in the condition, and have to stand somewhere.
  return Statement(db,
                   fmt::format("DELETE FROM table_entries WHERE {} "
                               "AND ?1 IS NOT NULL AND ?2 IS NOT NULL",
                               which),
                   static_cast<int>(cause),
                   NowNs(),
                   args...)
      .Run();
}

}  // namespace selfcal::server
