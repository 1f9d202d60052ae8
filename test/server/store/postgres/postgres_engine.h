// PostgreSQL as an engine of the tests of the store: one server for the
// process, and on it a database for each folder that a test has.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "server/store/driver/driver.h"
#include "server/store/store.h"
#include "test/server/store/postgres/postgres_cluster.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {

// The server, which starts when it is first needed.
PostgresCluster& SharedPostgres();

// The database that the folder stands for, which is created if the folder has
// none yet.
absl::StatusOr<std::unique_ptr<Database>> OpenPostgresDatabase(
    const TempFolder& folder);
// The store in it, while others are open, as by another daemon.
absl::StatusOr<std::unique_ptr<Store>> OpenSharedPostgresStore(
    const TempFolder& folder);

// Changes one byte in each blob of a column, around the triggers that forbid
// it.
absl::Status DamagePostgresColumn(const TempFolder& folder,
                                  const std::string& table,
                                  const std::string& column);

}  // namespace selfcal::server
