#include "server/store/database.h"

#include <fmt/format.h>

#include "server/store/database_file.h"
#include "server/store/status_macros.h"

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

absl::Status SetSafetyPragmas(Connection* connection) {
  return connection->Execute(
      "PRAGMA busy_timeout = 5000;"
      "PRAGMA trusted_schema = OFF;"
      "PRAGMA foreign_keys = ON;"
      "PRAGMA recursive_triggers = ON;"
      "PRAGMA cell_size_check = ON;"
      "PRAGMA synchronous = FULL");
}

absl::Status ApplyOne(Connection* connection,
                      const Migration& migration,
                      int version) {
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
                "INSERT INTO schema_migrations VALUES (?1, ?2, ?3, "
                "  CAST(strftime('%s', 'now') AS INTEGER) * 1000000000)",
                version,
                migration.name,
                migration.sha256)
          .Run());
  SELFCAL_RETURN_IF_ERROR(connection->Execute(
      fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}",
                  kApplicationId,
                  version)));
  return transaction.Commit();
}

absl::Status ApplyFrom(Connection* connection,
                       std::span<const Migration> migrations,
                       int version) {
  for (std::size_t k = version; k < migrations.size(); ++k) {
    const absl::Status status =
        ApplyOne(connection, migrations[k], static_cast<int>(k) + 1);
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
absl::Status VerifyApplied(Connection* connection,
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

absl::Status Backup(Connection* connection,
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
                    std::span<const Migration> migrations) {
  const std::string unfinished = path + ".new";
  SELFCAL_RETURN_IF_ERROR(RemoveDatabaseFiles(unfinished));
  {
    SELFCAL_ASSIGN_OR_RETURN(Connection connection,
                             Connection::Open(unfinished, kOpenFlags));
    SELFCAL_RETURN_IF_ERROR(SetSafetyPragmas(&connection));
    SELFCAL_RETURN_IF_ERROR(
        connection.Execute(fmt::format("PRAGMA page_size = {}", kPageBytes)));
    SELFCAL_RETURN_IF_ERROR(ApplyFrom(&connection, migrations, 0));
  }
  return RenameDurably(unfinished, path);
}

// Closing the last connection moves the write-ahead log into the file, which
// must not happen to a file that is about to be refused.
void SetCheckpointOnClose(Connection* connection, bool on) {
  sqlite3_db_config(connection->handle(),
                    SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE,
                    on ? 0 : 1,
                    nullptr);
}

}  // namespace

absl::Status VerifySchema(Connection* connection,
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

absl::StatusOr<Connection> OpenDatabase(const std::string& path,
                                        std::span<const Migration> migrations) {
  SELFCAL_ASSIGN_OR_RETURN(const DatabaseFile file, InspectDatabaseFile(path));
  if (file == DatabaseFile::kAbsent) {
    SELFCAL_RETURN_IF_ERROR(Create(path, migrations));
  }
  SELFCAL_ASSIGN_OR_RETURN(
      Connection connection,
      Connection::Open(path, kOpenFlags & ~SQLITE_OPEN_CREATE));
  SetCheckpointOnClose(&connection, false);
  SELFCAL_RETURN_IF_ERROR(SetSafetyPragmas(&connection));
  SELFCAL_RETURN_IF_ERROR(VerifySchema(&connection, path, migrations));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t version,
                           ReadInt(&connection, "PRAGMA user_version"));
  SetCheckpointOnClose(&connection, true);
  if (version < static_cast<int>(migrations.size())) {
    SELFCAL_RETURN_IF_ERROR(Backup(&connection, path, version));
    SELFCAL_RETURN_IF_ERROR(ApplyFrom(&connection, migrations, version));
  }
  SELFCAL_RETURN_IF_ERROR(connection.Execute(fmt::format(
      "PRAGMA journal_mode = WAL; PRAGMA cache_spill = -{}", kSpillKiB)));
  return connection;
}

}  // namespace selfcal::server
