#include "server/daemon/open_store.h"

#include <utility>

#include "server/status/status_macros.h"
#include "server/store/make_store.h"
#include "server/store/postgres/postgres.h"
#include "server/store/postgres/store_uri.h"
#include "server/store/sqlite/sqlite.h"

namespace selfcal::server {
namespace {

std::filesystem::path FileOf(const DaemonOptions& options) {
  return options.state_dir / "selfcal.db";
}

}  // namespace

bool OpenedStore::IsInPlace() const {
  return !identity || StillNames(file.string(), *identity);
}

std::string StoreName(const DaemonOptions& options) {
  if (options.store.empty()) return FileOf(options).string();
  return ShownUri(options.store).value_or("the store");
}

absl::Status CheckStoreSettings(const DaemonOptions& options) {
  if (options.store.empty()) return absl::OkStatus();
  SELFCAL_RETURN_IF_ERROR(ShownUri(options.store).status());
  if (options.domain.quotas.max_database_bytes == 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "max-database-bytes limits an SQLite file and has no effect on the "
      "database of a server: remove it, and set a quota by rig");
}

absl::StatusOr<OpenedStore> OpenStore(const DaemonOptions& options,
                                      std::int64_t time_ns) {
  OpenedStore opened;
  if (!options.store.empty()) {
    SELFCAL_ASSIGN_OR_RETURN(
        auto database,
        OpenPostgres({.uri = options.store, .time_ns = time_ns}));
    opened.store = MakeStore(std::move(database));
    return opened;
  }
  opened.file = FileOf(options);
  SELFCAL_ASSIGN_OR_RETURN(
      auto database,
      OpenSqlite({.path = opened.file.string(),
                  .max_bytes = options.domain.quotas.max_database_bytes,
                  .time_ns = time_ns}));
  SELFCAL_ASSIGN_OR_RETURN(opened.identity, IdentityOf(opened.file.string()));
  opened.store = MakeStore(std::move(database));
  return opened;
}

absl::Status CheckStoreServer(const DaemonOptions& options) {
  if (options.store.empty()) return absl::OkStatus();
  return CheckPostgres(options.store);
}

}  // namespace selfcal::server
