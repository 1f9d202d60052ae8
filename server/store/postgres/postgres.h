// The driver for PostgreSQL: a database of a server that is run by others, with
// its own replication, failover and backups.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

#include "server/store/driver/driver.h"

namespace selfcal::server {

struct PostgresOptions {
  // As in store_uri.h. What it does not contain, libpq takes from the
  // environment (PGPASSWORD) and from its files (~/.pgpass).
  std::string uri;
  int writers = 8;  // connections that write
  int readers = 8;  // connections that read
  // Recorded as the time of the migrations that are applied [ns since the Unix
  // epoch].
  std::int64_t time_ns = 0;
};

// Opens the database, creating or migrating its tables. Errors as for
// PostgresConnection::Open and OpenSchema (open_schema.h).
absl::StatusOr<std::unique_ptr<Database>> OpenPostgres(
    const PostgresOptions& options);

// Whether OpenPostgres would succeed; changes nothing.
absl::Status CheckPostgres(const std::string& uri);

}  // namespace selfcal::server
