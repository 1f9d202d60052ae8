#include "server/store/sqlite/open_database.h"

#include <fmt/format.h>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/sqlite/database_file.h"

namespace selfcal::server {
namespace {

constexpr int kOpenFlags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;

// Page size of a new database; an existing one keeps its own. Twice SQLite's
// default halves the calls for the data of a segment, which spans many pages;
// larger pages would write more for each changed row.
constexpr int kPageBytes = 8192;

// Keeps a group of segments in memory until its commit: a page that is written
// to the log before that is written again when it changes once more. Memory
// beyond the cache is released after the commit.
constexpr int kSpillKiB = 16 << 10;

absl::Status SetSafetyPragmas(SqliteConnection* connection) {
  return connection->Execute(
      "PRAGMA busy_timeout = 5000;"
      "PRAGMA trusted_schema = OFF;"
      "PRAGMA foreign_keys = ON;"
      "PRAGMA recursive_triggers = ON;"
      "PRAGMA cell_size_check = ON;"
      "PRAGMA synchronous = FULL");
}

absl::Status ApplyOne(SqliteConnection* connection,
                      const Migration& migration,
                      int version,
                      std::int64_t time_ns) {
  Transaction transaction(connection);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_RETURN_IF_ERROR(
      connection->Execute("CREATE TABLE IF NOT EXISTS schema_migrations ("
                          "  version INTEGER PRIMARY KEY,"
                          "  name TEXT NOT NULL,"
                          "  sha256 TEXT NOT NULL,"
                          "  apply_time_ns INTEGER NOT NULL) STRICT"));
  SELFCAL_RETURN_IF_ERROR(connection->Execute(std::string(migration.sql)));
  SELFCAL_RETURN_IF_ERROR(
      Statement(connection,
                "INSERT INTO schema_migrations (version, name, sha256, "
                "  apply_time_ns) VALUES (?1, ?2, ?3, ?4)",
                version,
                migration.name,
                migration.sha256,
                time_ns)
          .Run());
  SELFCAL_RETURN_IF_ERROR(connection->Execute(
      fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}",
                  kApplicationId,
                  version)));
  return transaction.Commit();
}

absl::Status ApplyFrom(SqliteConnection* connection,
                       std::span<const Migration> migrations,
                       int version,
                       std::int64_t time_ns) {
  for (std::size_t k = version; k < migrations.size(); ++k) {
    const absl::Status status =
        ApplyOne(connection, migrations[k], static_cast<int>(k) + 1, time_ns);
    if (!status.ok()) {
      return absl::Status(status.code(),
                          fmt::format("migration {} failed, the database is as "
                                      "it was before it: {}",
                                      migrations[k].name,
                                      std::string(status.message())));
    }
  }
  return absl::OkStatus();
}

// Verifies that the applied migrations are those of this program.
absl::Status VerifyApplied(SqliteConnection* connection,
                           std::span<const Migration> migrations,
                           int version) {
  Statement read(connection,
                 "SELECT version, sha256 FROM schema_migrations "
                 "ORDER BY version");
  int count = 0;
  while (read.Next()) {
    const std::int64_t recorded = read.Int(0);
    if (recorded != ++count || count > version ||
        read.Text(1) != migrations[count - 1].sha256) {
      return absl::FailedPreconditionError(fmt::format(
          "migration {} of the database is not the one of this program; it was "
          "written by another build: use that one, or restore a backup",
          recorded));
    }
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (count != version) {
    return absl::FailedPreconditionError(
        "the record of migrations does not reach the version of the database; "
        "restore a backup");
  }
  return absl::OkStatus();
}

absl::Status Backup(SqliteConnection* connection,
                    const std::string& path,
                    int version) {
  const std::string name = fmt::format("{}.backup-v{}", path, version);
  const std::string unfinished = name + ".new";
  SELFCAL_RETURN_IF_ERROR(RemoveDatabaseFiles(unfinished));
  SELFCAL_RETURN_IF_ERROR(
      Statement(connection, "VACUUM INTO ?1", unfinished).Run());
  return RenameDurably(unfinished, name);
}

absl::Status Create(const std::string& path,
                    std::span<const Migration> migrations,
                    std::int64_t time_ns) {
  const std::string unfinished = path + ".new";
  SELFCAL_RETURN_IF_ERROR(RemoveDatabaseFiles(unfinished));
  {
    SELFCAL_ASSIGN_OR_RETURN(const auto connection,
                             SqliteConnection::Open(unfinished, kOpenFlags));
    SELFCAL_RETURN_IF_ERROR(SetSafetyPragmas(connection.get()));
    // A file that is not finished is of no use after a crash: it is synced
    // once, before it gets its name.
    SELFCAL_RETURN_IF_ERROR(connection->Execute(
        fmt::format("PRAGMA page_size = {}; PRAGMA synchronous = OFF; "
                    "PRAGMA journal_mode = MEMORY",
                    kPageBytes)));
    SELFCAL_RETURN_IF_ERROR(
        ApplyFrom(connection.get(), migrations, 0, time_ns));
  }
  return RenameDurably(unfinished, path);
}

// Closing the last connection moves the write-ahead log into the file, which
// must not happen to a file that is about to be refused.
void SetCheckpointOnClose(SqliteConnection* connection, bool on) {
  sqlite3_db_config(connection->handle(),
                    SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE,
                    on ? 0 : 1,
                    nullptr);
}

}  // namespace

absl::Status VerifySchema(SqliteConnection* connection,
                          const std::string& path,
                          std::span<const Migration> migrations) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t version,
                           ReadInt(connection, "PRAGMA user_version"));
  const int newest = static_cast<int>(migrations.size());
  if (version > newest) {
    return absl::FailedPreconditionError(fmt::format(
        "{} has schema version {}, this program knows up to {}; it was left as "
        "it is. Use the program that wrote it, or its backup of version {}",
        path,
        version,
        newest,
        newest));
  }
  if (version < 1) {
    return absl::FailedPreconditionError(fmt::format(
        "{} has no schema version; it was left as it is. Restore a backup",
        path));
  }
  return VerifyApplied(connection, migrations, version);
}

absl::StatusOr<std::unique_ptr<SqliteConnection>> OpenDatabase(
    const std::string& path,
    std::span<const Migration> migrations,
    std::int64_t time_ns) {
  SELFCAL_ASSIGN_OR_RETURN(const DatabaseFile file, InspectDatabaseFile(path));
  if (file == DatabaseFile::kAbsent) {
    SELFCAL_RETURN_IF_ERROR(Create(path, migrations, time_ns));
  }
  SELFCAL_ASSIGN_OR_RETURN(
      auto connection,
      SqliteConnection::Open(path, kOpenFlags & ~SQLITE_OPEN_CREATE));
  SetCheckpointOnClose(connection.get(), false);
  SELFCAL_RETURN_IF_ERROR(SetSafetyPragmas(connection.get()));
  SELFCAL_RETURN_IF_ERROR(VerifySchema(connection.get(), path, migrations));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t version,
                           ReadInt(connection.get(), "PRAGMA user_version"));
  SetCheckpointOnClose(connection.get(), true);
  if (version < static_cast<int>(migrations.size())) {
    SELFCAL_RETURN_IF_ERROR(Backup(connection.get(), path, version));
    SELFCAL_RETURN_IF_ERROR(
        ApplyFrom(connection.get(), migrations, version, time_ns));
  }
  SELFCAL_RETURN_IF_ERROR(connection->Execute(fmt::format(
      "PRAGMA journal_mode = WAL; PRAGMA cache_spill = -{}", kSpillKiB)));
  return connection;
}

}  // namespace selfcal::server
