#include "server/store/sqlite/sqlite_connection.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/sqlite/schema_check.h"
#include "server/store/sqlite/sqlite_statement.h"

namespace selfcal::server {
namespace {

// BEGIN IMMEDIATE: two transactions that write exclude each other from the
// start, so that none fails half way.
constexpr Dialect kDialect{.begin_write = "BEGIN IMMEDIATE",
                           .begin_read = "BEGIN",
                           .for_update = "",
                           .blob_type = "BLOB"};

absl::StatusCode CanonicalCode(int primary) {
  switch (primary) {
    case SQLITE_FULL:
    case SQLITE_NOMEM:
      return absl::StatusCode::kResourceExhausted;
    case SQLITE_IOERR:
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_PERM:
      return absl::StatusCode::kUnavailable;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::StatusCode::kDataLoss;
    default:
      return absl::StatusCode::kInternal;
  }
}

std::string_view Advice(int primary) {
  switch (primary) {
    case SQLITE_FULL:
      return "the disk is full: free some space and try again; nothing was "
             "changed";
    case SQLITE_NOMEM:
      return "memory is short: try again later; nothing was changed";
    case SQLITE_IOERR:
      return "the disk failed: check it and the system's log, then restart the "
             "daemon; nothing was changed";
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return "another process holds the database: end it and try again";
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_PERM:
      return "the database cannot be opened for writing: check that its folder "
             "exists and belongs to the daemon's user";
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return "the database is damaged: stop the daemon, keep a copy of the "
             "file, and put a backup in its place";
    default:
      return "this is a defect of the program: please report it";
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteConnection>> SqliteConnection::Open(
    const std::string& path, int flags) {
  sqlite3* handle = nullptr;
  const int code = sqlite3_open_v2(path.c_str(), &handle, flags, nullptr);
  // To be closed even if opening failed.
  std::unique_ptr<SqliteConnection> connection(new SqliteConnection(handle));
  if (code != SQLITE_OK) return connection->StatusOf(code, "open " + path);
  sqlite3_extended_result_codes(handle, 1);
  return connection;
}

absl::StatusOr<std::unique_ptr<SqliteConnection>> SqliteConnection::OpenReader(
    const std::string& path) {
  SELFCAL_ASSIGN_OR_RETURN(auto connection, Open(path, SQLITE_OPEN_READONLY));
  SELFCAL_RETURN_IF_ERROR(
      connection->Execute("PRAGMA busy_timeout = 5000;"
                          "PRAGMA trusted_schema = OFF;"
                          "PRAGMA cell_size_check = ON"));
  return connection;
}

absl::Status SqliteConnection::Execute(const std::string& sql) {
  return StatusOf(
      sqlite3_exec(handle(), sql.c_str(), nullptr, nullptr, nullptr), sql);
}

const Dialect& SqliteConnection::dialect() const { return kDialect; }

absl::StatusOr<DatabaseSize> SqliteConnection::Size() {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t pages,
                           ReadInt(this, "PRAGMA page_count"));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t free,
                           ReadInt(this, "PRAGMA freelist_count"));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t page_bytes,
                           ReadInt(this, "PRAGMA page_size"));
  return DatabaseSize{pages * page_bytes, (pages - free) * page_bytes};
}

absl::StatusOr<std::optional<DiskSpace>> SqliteConnection::Disk() {
  const char* path = sqlite3_db_filename(handle_.get(), "main");
  std::error_code error;
  const auto space = std::filesystem::space(path, error);
  if (error) {
    return absl::UnavailableError(fmt::format(
        "the free space beside {} is not known: {}", path, error.message()));
  }
  return DiskSpace{static_cast<std::int64_t>(space.capacity),
                   static_cast<std::int64_t>(space.available)};
}

absl::StatusOr<std::vector<Column>> SqliteConnection::Columns() {
  Statement read(this,
                 "SELECT t.name, c.name, c.type FROM sqlite_schema t "
                 "JOIN pragma_table_info(t.name) c "
                 "WHERE t.type = 'table' AND t.name NOT LIKE 'sqlite%' "
                 "  AND t.name <> 'schema_migrations' "
                 "ORDER BY t.name, c.cid");
  std::vector<Column> columns;
  while (read.Next()) {
    columns.push_back({read.Text(0), read.Text(1), read.Text(2)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return columns;
}

void SqliteConnection::CheckStructure(
    const std::function<bool(const StoreProblem&)>& on_problem) {
  CheckSqliteStructure(this, on_problem);
}

absl::Status SqliteConnection::StatusOf(int code, std::string_view what) const {
  if (code == SQLITE_OK || code == SQLITE_ROW || code == SQLITE_DONE) {
    return absl::OkStatus();
  }
  const int primary = code & 0xff;
  const char* words =
      handle_ ? sqlite3_errmsg(handle_.get()) : sqlite3_errstr(code);
  return absl::Status(CanonicalCode(primary),
                      fmt::format("{} (SQLite {}: {}; at: {})",
                                  Advice(primary),
                                  code,
                                  words,
                                  what.substr(0, 120)));
}

absl::StatusOr<std::unique_ptr<PreparedStatement>> SqliteConnection::Prepare(
    std::string_view sql) {
  return SqliteStatement::Prepare(this, sql);
}

}  // namespace selfcal::server
