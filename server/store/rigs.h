// Rigs in the database.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

struct RigRow {
  std::int64_t rowid = 0;
  StoredRig stored;
};

// With its tables and version 1, in one transaction. ALREADY_EXISTS.
absl::StatusOr<StoredRig> CreateRigRow(Connection* db,
                                       const Rig& rig,
                                       const RigPolicy& policy);

// NOT_FOUND.
absl::StatusOr<std::int64_t> FindRigId(Connection* db, const std::string& rig);
absl::StatusOr<RigRow> ReadRig(Connection* db, const std::string& rig);

// By name.
absl::StatusOr<Listed<StoredRig>> ListRigRows(Connection* db, const Page& page);

}  // namespace selfcal::server
