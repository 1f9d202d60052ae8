// Brings the schema of a database to that of the program, creating it in an
// empty one.
//
// Each migration is one transaction. Programs that start at the same time wait
// for each other by an advisory lock, and each migration is applied once.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <span>

#include "migrations/migrations.h"
#include "server/store/postgres/postgres_connection.h"

namespace selfcal::server {

// `time_ns` is recorded as the time of the migrations that are applied [ns
// since the Unix epoch]. FAILED_PRECONDITION, and nothing is changed, if the
// schema contains tables of another program, is of a newer version, or its
// migrations differ from these.
absl::Status OpenSchema(PostgresConnection* connection,
                        std::span<const Migration> migrations,
                        std::int64_t time_ns);

// The number of migrations that were applied. Changes nothing; errors as for
// OpenSchema.
absl::StatusOr<int> AppliedMigrations(PostgresConnection* connection,
                                      std::span<const Migration> migrations);

}  // namespace selfcal::server
