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

#include <span>
#include <string>

#include "migrations/migrations.h"
#include "server/store/statement.h"

namespace selfcal::server {

// Returns the one connection that writes: WAL, synchronous=FULL, foreign keys.
// FAILED_PRECONDITION if the file is not a database of this program, is of a
// newer version, or its migrations differ from the embedded ones; DATA_LOSS if
// it is damaged; UNAVAILABLE if the disk fails.
absl::StatusOr<Connection> OpenDatabase(const std::string& path,
                                        std::span<const Migration> migrations);

// FAILED_PRECONDITION unless this program can open or migrate the database.
// `path` is for the message.
absl::Status VerifySchema(Connection* connection,
                          const std::string& path,
                          std::span<const Migration> migrations);

}  // namespace selfcal::server
