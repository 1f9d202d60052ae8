// The store on SQLite: one file, one connection that writes and one that only
// reads. (SQLite before 3.51.3 can corrupt its write-ahead log if several
// connections write or checkpoint at once; here only one ever does.)
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

#include "server/store/store.h"

namespace selfcal::server {

// Opens the database at `path`, or creates it in an existing folder; a restored
// database that waits replaces it first (restore.h). Only one process may use
// the file: the caller holds a lock on its state folder. The file grows to at
// most `max_bytes`; 0 for no limit. Errors as for OpenDatabase (database.h).
absl::StatusOr<std::unique_ptr<Store>> MakeSqliteStore(
    const std::string& path, std::int64_t max_bytes = 0);

}  // namespace selfcal::server
