// The store on an SQLite file.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "server/domain/clock.h"
#include "server/store/make_store.h"
#include "server/store/sqlite/sqlite.h"

namespace selfcal::server {

// Errors as for OpenSqlite.
inline absl::StatusOr<std::unique_ptr<Store>> OpenSqliteStore(
    const std::string& path, std::int64_t max_bytes = 0) {
  auto database =
      OpenSqlite({.path = path, .max_bytes = max_bytes, .time_ns = NowNs()});
  if (!database.ok()) return database.status();
  return MakeStore(*std::move(database));
}

}  // namespace selfcal::server
