// The database of the daemon: an SQLite file in its state directory or, with
// the setting `store`, that of a PostgreSQL server.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "server/daemon/options.h"
#include "server/store/sqlite/file_identity.h"
#include "server/store/store.h"

namespace selfcal::server {

struct OpenedStore {
  std::unique_ptr<Store> store;
  std::filesystem::path file;            // empty for a server
  std::optional<FileIdentity> identity;  // of the file

  // False if the file was removed or replaced since: what is written to it is
  // lost.
  bool IsInPlace() const;
};

// The file, or the address of the server without a password.
std::string StoreName(const DaemonOptions& options);

// INVALID_ARGUMENT if settings contradict each other.
absl::Status CheckStoreSettings(const DaemonOptions& options);

// Opens the database, creating or migrating it if necessary. `time_ns` is
// recorded as the time of the migrations that are applied [ns since the Unix
// epoch]. Errors as for OpenSqlite and OpenPostgres.
absl::StatusOr<OpenedStore> OpenStore(const DaemonOptions& options,
                                      std::int64_t time_ns);

// Whether the server, if there is one, can be reached and its database opened;
// changes nothing. CheckStateFolder checks a file.
absl::Status CheckStoreServer(const DaemonOptions& options);

}  // namespace selfcal::server
