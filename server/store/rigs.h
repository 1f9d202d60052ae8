// Records of rigs.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Returns its key. ALREADY_EXISTS.
absl::StatusOr<std::int64_t> InsertRig(Connection* db, const StoredRig& rig);
// Replaces the definition and the labels of the rig.
absl::Status WriteRig(UnitOfWork* tx, const StoredRig& rig);
// Replaces the rows of its labels, by which rigs are searched.
absl::Status WriteLabels(UnitOfWork* tx, const StoredRig& rig);
// Deletes everything that is stored of the rig, except its events.
absl::Status DeleteRigRows(UnitOfWork* tx);

// NOT_FOUND.
absl::StatusOr<std::int64_t> FindRigId(Connection* db, const std::string& rig);
// FindRigId for a transaction that writes: until it ends, no other one writes
// records of the rig.
absl::StatusOr<std::int64_t> LockRig(Connection* db, const std::string& rig);
// NOT_FOUND; DATA_LOSS if the record is damaged.
absl::StatusOr<StoredRig> ReadRig(Connection* db, const std::string& rig);
absl::StatusOr<StoredRig> ReadRig(UnitOfWork* tx);
// Store::GetRigs.
absl::StatusOr<std::map<std::string, StoredRig>> ReadRigs(
    Connection* db, const std::set<std::string>& names);
// Store::GetRigKeys.
absl::StatusOr<std::map<std::string, std::int64_t>> ReadRigKeys(
    Connection* db, const std::set<std::string>& names);
// The bits of server/domain/alarms.h.
absl::Status WriteAlarms(UnitOfWork* tx, std::int64_t alarms);
// Sets these bits of the rigs from which their devices have not reported since
// then.
absl::Status RaiseSilent(Connection* db,
                         std::int64_t before_ns,
                         std::int64_t alarms);

// Number of rigs in the database.
absl::StatusOr<std::int64_t> CountRigs(UnitOfWork* tx);

}  // namespace selfcal::server
