#include "server/store/sqlite/sqlite.h"

#include <fmt/format.h>

#include <algorithm>

#include "migrations/migrations.h"
#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/sqlite/open_database.h"
#include "server/store/sqlite/restore.h"
#include "server/store/sqlite/sqlite_database.h"

namespace selfcal::server {
namespace {

// Limits the size of the file; 0 for no limit.
absl::Status LimitSize(SqliteConnection* db, std::int64_t max_bytes) {
  if (max_bytes == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t page_bytes,
                           ReadInt(db, "PRAGMA page_size"));
  return db->Execute(
      fmt::format("PRAGMA max_page_count = {}",
                  std::max<std::int64_t>(1, max_bytes / page_bytes)));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Database>> OpenSqlite(
    const SqliteOptions& options) {
  SELFCAL_RETURN_IF_ERROR(TakeOverRestored(options.path));
  const auto open =
      [options]() -> absl::StatusOr<std::unique_ptr<SqliteConnection>> {
    SELFCAL_ASSIGN_OR_RETURN(
        auto db,
        OpenDatabase(options.path, SqliteMigrations(), options.time_ns));
    SELFCAL_RETURN_IF_ERROR(LimitSize(db.get(), options.max_bytes));
    return db;
  };
  SELFCAL_ASSIGN_OR_RETURN(std::unique_ptr<Database> db,
                           SqliteDatabase::Open(options.path, open));
  return db;
}

}  // namespace selfcal::server
