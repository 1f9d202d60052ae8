// Records of the daemons that share the database, its replicas, and of what
// they have claimed (rig_claim.h).
//
// A replica has a record while it runs, and renews it by a beat: a number that
// grows. No clock is compared: others see by their own clocks that a beat does
// not grow any more, and remove the record, after which its claims are free. If
// it goes on nevertheless, it has no claim.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/store/rig_claim.h"

namespace selfcal::server {

struct ReplicaRecord {
  std::string replica;  // a name that no other one ever has
  std::int64_t beat = 0;
};

// Any thread may call. Errors as for Store.
class Replicas {
 public:
  virtual ~Replicas() = default;

  // Writes the record of a replica that has begun.
  virtual absl::Status Add(const std::string& replica) = 0;
  // Renews it. NOT_FOUND if it was removed.
  virtual absl::Status Beat(const std::string& replica) = 0;
  virtual absl::StatusOr<std::vector<ReplicaRecord>> List() = 0;
  // Removes the record if its beat is still this one.
  virtual absl::Status Remove(const ReplicaRecord& record) = 0;
  // Removes the record of a replica that ends.
  virtual absl::Status Remove(const std::string& replica) = 0;

  // Some of the rigs that have unscored segments or an unfinished run and are
  // not claimed by a replica that has a record.
  virtual absl::StatusOr<std::vector<std::string>> ListUnclaimed(int limit) = 0;
  // Those claims of the replica whose rigs have such work.
  virtual absl::StatusOr<std::vector<RigClaim>> ListBusy(
      const std::string& replica) = 0;
  // Claims the rig; nullopt if another replica that has a record did so before.
  // NOT_FOUND if there is no such rig, or no record of the replica.
  virtual absl::StatusOr<std::optional<RigClaim>> Claim(
      const std::string& rig, const std::string& replica) = 0;
  // Gives a claim up, if it still holds.
  virtual absl::Status Release(const RigClaim& claim) = 0;
};

class Connection;  // driver/driver.h
class Database;    // driver/driver.h

// `database` must outlive it.
std::unique_ptr<Replicas> MakeReplicas(Database* database);

// OK if the claim, whose rig has this key and is locked by the transaction,
// still holds; else ClaimLost.
absl::Status CheckClaim(Connection* db,
                        std::int64_t rig_row,
                        const RigClaim& claim);

}  // namespace selfcal::server
