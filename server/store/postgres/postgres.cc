#include "server/store/postgres/postgres.h"

#include "migrations/migrations.h"
#include "server/status/status_macros.h"
#include "server/store/postgres/open_schema.h"
#include "server/store/postgres/postgres_connection.h"
#include "server/store/postgres/postgres_database.h"

namespace selfcal::server {

absl::StatusOr<std::unique_ptr<Database>> OpenPostgres(
    const PostgresOptions& options) {
  {
    SELFCAL_ASSIGN_OR_RETURN(const auto connection,
                             PostgresConnection::Open(options.uri));
    SELFCAL_RETURN_IF_ERROR(
        OpenSchema(connection.get(), PostgresMigrations(), options.time_ns));
  }
  return std::make_unique<PostgresDatabase>(
      options.uri, options.writers, options.readers);
}

absl::Status CheckPostgres(const std::string& uri) {
  SELFCAL_ASSIGN_OR_RETURN(const auto connection,
                           PostgresConnection::Open(uri));
  return AppliedMigrations(connection.get(), PostgresMigrations()).status();
}

}  // namespace selfcal::server
