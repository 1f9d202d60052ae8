// The store on SQLite: one file, one connection that writes and one that only
// reads. (SQLite before 3.51.3 can corrupt its write-ahead log where several
// connections write or checkpoint at once; here only one ever does.)
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

#include "server/store/store.h"

namespace selfcal::server {

// Opens the database at `path`, or creates it in a folder that exists. Errors
// as OpenDatabase (database.h). One process for one file: the caller holds a
// lock on its state folder. A database that was restored takes its place first
// (restore.h). The file grows to at most `max_bytes`; 0: to any size.
absl::StatusOr<std::unique_ptr<Store>> MakeSqliteStore(
    const std::string& path, std::int64_t max_bytes = 0);

}  // namespace selfcal::server
