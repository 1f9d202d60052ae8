// Opens the daemon's database at the schema of the program, creating or
// migrating it if necessary.
//
// A file at `path` is modified only if it is a database of this program and not
// of a newer version. A new database is created under another name (path.new)
// and then renamed, so that being killed leaves either nothing or a complete
// database. Each migration is one transaction; before the first one, the
// database is copied to path.backup-v<old>.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "migrations/migrations.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace selfcal::server {

// Returns the one connection that writes: WAL, synchronous=FULL, foreign keys.
// `time_ns` is recorded as the time of the migrations that are applied [ns
// since the Unix epoch]. FAILED_PRECONDITION if the file is not a database of
// this program, is of a newer version, or its migrations differ from the
// embedded ones; DATA_LOSS if it is damaged; UNAVAILABLE if the disk fails.
absl::StatusOr<std::unique_ptr<SqliteConnection>> OpenDatabase(
    const std::string& path,
    std::span<const Migration> migrations,
    std::int64_t time_ns);

// FAILED_PRECONDITION unless this program can open or migrate the database.
// `path` is for the message.
absl::Status VerifySchema(SqliteConnection* connection,
                          const std::string& path,
                          std::span<const Migration> migrations);

}  // namespace selfcal::server
