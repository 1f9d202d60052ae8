// The driver for SQLite: one file, one connection that writes and one that only
// reads. (SQLite before 3.51.3 can corrupt its write-ahead log if several
// connections write or checkpoint at once; here only one ever does.)
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

#include "server/store/driver/driver.h"

namespace selfcal::server {

struct SqliteOptions {
  std::string path;            // in an existing folder
  std::int64_t max_bytes = 0;  // the file grows to at most this; 0: no limit
  // Recorded as the time of the migrations that are applied [ns since the Unix
  // epoch].
  std::int64_t time_ns = 0;
};

// Opens the database or creates it; a restored database that waits replaces it
// first (restore.h). Only one process may use the file: the caller holds a lock
// on its folder. Errors as for OpenDatabase (open_database.h).
absl::StatusOr<std::unique_ptr<Database>> OpenSqlite(
    const SqliteOptions& options);

}  // namespace selfcal::server
