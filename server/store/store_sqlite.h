// The store on SQLite: one file, one connection that writes and one that only
// reads. (SQLite before 3.51.3 can corrupt its write-ahead log where several
// connections write or checkpoint at once; here only one ever does.)
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "server/store/store.h"
#include "server/store/store_options.h"

namespace selfcal::server {

// Opens the database at `path`, or creates it in a folder that exists. Errors
// as OpenDatabase (database.h). One process for one file: the caller holds a
// lock on its state folder. A database that was restored takes its place first
// (restore.h).
absl::StatusOr<std::unique_ptr<Store>> MakeSqliteStore(
    const std::string& path, const StoreOptions& options = {});

}  // namespace selfcal::server
