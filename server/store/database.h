// Opens the database of the daemon at the schema of the program: creates it,
// verifies it, or migrates it.
//
// The file at `path` is only ever touched if it is a database of this program
// and not from a newer one. Creation happens under another name (path.new), so
// that a kill leaves either nothing or a complete database. A migration is one
// transaction, after a copy of the database was left at path.backup-v<old>.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>

#include "migrations/migrations.h"
#include "server/store/statement.h"

namespace selfcal::server {

// The one connection that writes: WAL, synchronous=FULL, foreign keys.
// FAILED_PRECONDITION: not ours, from a newer program, or applied migrations
// differ from those embedded. DATA_LOSS: damaged. UNAVAILABLE: the disk.
absl::StatusOr<Connection> OpenDatabase(const std::string& path,
                                        std::span<const Migration> migrations);

// Whether a database is one that this program opens as it is or migrates.
// FAILED_PRECONDITION otherwise. `path` is for the message.
absl::Status VerifySchema(Connection* connection,
                          const std::string& path,
                          std::span<const Migration> migrations);

}  // namespace selfcal::server
