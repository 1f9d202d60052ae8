#include "server/store/postgres/open_schema.h"

#include <fmt/format.h>

#include <string>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"

namespace selfcal::server {
namespace {

// Names the lock within the database; "selfcal" in ASCII.
constexpr std::int64_t kLock = 0x73656c6663616c;

constexpr char kForeign[] =
    "the schema of the database contains tables of another program; it was "
    "left "
    "as it is. Create a database for selfcal alone";

// Whether the columns of the record of migrations are those that ApplyOne
// creates; other programs have a table of this name as well.
absl::StatusOr<bool> HasRecord(PostgresConnection* connection) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t columns,
      ReadInt(connection,
              "SELECT count(*) FROM information_schema.columns "
              "WHERE table_schema = current_schema() "
              "  AND table_name = 'schema_migrations' AND column_name IN "
              "  ('version', 'name', 'sha256', 'apply_time_ns')"));
  return columns == 4;
}

absl::StatusOr<bool> IsEmpty(PostgresConnection* connection) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t relations,
      ReadInt(connection,
              "SELECT count(*) FROM pg_class "
              "WHERE relnamespace = current_schema()::regnamespace "
              "  AND relkind IN ('r', 'p', 'v', 'm', 'f', 'S')"));
  return relations == 0;
}

absl::Status ApplyOne(PostgresConnection* connection,
                      const Migration& migration,
                      int version,
                      std::int64_t time_ns) {
  SELFCAL_RETURN_IF_ERROR(
      connection->Execute("CREATE TABLE IF NOT EXISTS schema_migrations ("
                          "  version BIGINT PRIMARY KEY,"
                          "  name TEXT NOT NULL,"
                          "  sha256 TEXT NOT NULL,"
                          "  apply_time_ns BIGINT NOT NULL)"));
  const absl::Status applied = connection->Execute(std::string(migration.sql));
  if (!applied.ok()) {
    return absl::Status(applied.code(),
                        fmt::format("migration {} failed, the database is as "
                                    "it was before it: {}",
                                    migration.name,
                                    std::string(applied.message())));
  }
  return Statement(connection,
                   "INSERT INTO schema_migrations (version, name, sha256, "
                   "  apply_time_ns) VALUES (?1, ?2, ?3, ?4)",
                   version,
                   migration.name,
                   migration.sha256,
                   time_ns)
      .Run();
}

}  // namespace

absl::StatusOr<int> AppliedMigrations(PostgresConnection* connection,
                                      std::span<const Migration> migrations) {
  SELFCAL_ASSIGN_OR_RETURN(const bool has_record, HasRecord(connection));
  if (!has_record) {
    SELFCAL_ASSIGN_OR_RETURN(const bool is_empty, IsEmpty(connection));
    if (!is_empty) return absl::FailedPreconditionError(kForeign);
    return 0;
  }
  Statement read(connection,
                 "SELECT version, sha256 FROM schema_migrations "
                 "ORDER BY version");
  int version = 0;
  bool differs = false;
  while (read.Next()) {
    const std::int64_t recorded = read.Int(0);
    differs = differs || recorded != ++version ||
              (recorded <= static_cast<std::int64_t>(migrations.size()) &&
               read.Text(1) != migrations[version - 1].sha256);
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (differs || version == 0) {
    return absl::FailedPreconditionError(
        "the migrations of the database are not those of this program; it was "
        "written by another build: use that one, or restore a backup");
  }
  if (version > static_cast<int>(migrations.size())) {
    return absl::FailedPreconditionError(
        fmt::format("the database has schema version {}, this program knows up "
                    "to {}; it was left as it is. Use the program that wrote "
                    "it, or a backup from before",
                    version,
                    migrations.size()));
  }
  return version;
}

absl::Status OpenSchema(PostgresConnection* connection,
                        std::span<const Migration> migrations,
                        std::int64_t time_ns) {
  for (;;) {
    Transaction transaction(connection);
    SELFCAL_RETURN_IF_ERROR(transaction.status());
    SELFCAL_RETURN_IF_ERROR(
        ReadInt(connection,
                "SELECT 1 FROM (SELECT pg_advisory_xact_lock(?1)) locked",
                kLock)
            .status());
    SELFCAL_ASSIGN_OR_RETURN(const int version,
                             AppliedMigrations(connection, migrations));
    if (version == static_cast<int>(migrations.size())) {
      return transaction.Commit();
    }
    SELFCAL_RETURN_IF_ERROR(
        ApplyOne(connection, migrations[version], version + 1, time_ns));
    SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  }
}

}  // namespace selfcal::server
