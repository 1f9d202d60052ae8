#include "server/store/replicas.h"

#include <fmt/format.h>

#include <type_traits>

#include "server/status/status_macros.h"
#include "server/store/driver/driver.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/own_rig.h"
#include "server/store/rigs.h"
#include "server/store/unscored_rigs.h"

namespace selfcal::server {
namespace {

absl::Status NoRecord(const std::string& replica) {
  return absl::NotFoundError(
      fmt::format("there is no record of replica {}", replica));
}

// 1 if there is a record of the replica, which the transaction keeps.
absl::StatusOr<bool> Exists(Connection* db, const std::string& replica) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t count,
      ReadInt(db, "SELECT COUNT(*) FROM replicas WHERE replica = ?1", replica));
  return count > 0;
}

struct StoredClaim {
  std::string replica;  // empty: nobody's
  std::int64_t number = 0;
};

absl::StatusOr<StoredClaim> ReadClaim(Connection* db, std::int64_t rig) {
  Statement read(db, "SELECT replica, number FROM claims WHERE rig = ?1", rig);
  StoredClaim claim;
  if (read.Next()) claim = {read.Text(0), read.Int(1)};
  SELFCAL_RETURN_IF_ERROR(read.status());
  return claim;
}

absl::Status WriteClaim(Connection* db,
                        std::int64_t rig,
                        const StoredClaim& claim) {
  return Statement(db,
                   "INSERT INTO claims (rig, replica, number) "
                   "VALUES (?1, ?2, ?3) "
                   "ON CONFLICT (rig) DO UPDATE SET replica = ?2, number = ?3",
                   rig,
                   claim.replica,
                   claim.number)
      .Run();
}

class ReplicasOfDatabase final : public Replicas {
 public:
  explicit ReplicasOfDatabase(Database* db) : db_(db) {}

  absl::Status Add(const std::string& replica) override {
    return WriteInTransaction(db_, [&](Connection* db) {
      return Statement(db,
                       "INSERT INTO replicas (replica, beat) VALUES (?1, 1)",
                       replica)
          .Run();
    });
  }

  absl::Status Beat(const std::string& replica) override {
    return WriteInTransaction(db_, [&](Connection* db) -> absl::Status {
      SELFCAL_ASSIGN_OR_RETURN(
          const std::int64_t beat,
          InsertReturning(db,
                          "UPDATE replicas SET beat = beat + 1 "
                          "WHERE replica = ?1 RETURNING beat",
                          replica));
      return beat > 0 ? absl::OkStatus() : NoRecord(replica);
    });
  }

  absl::StatusOr<std::vector<ReplicaRecord>> List() override {
    std::vector<ReplicaRecord> records;
    SELFCAL_RETURN_IF_ERROR(db_->ReadForService([&](Connection* db) {
      records.clear();
      Statement read(db, "SELECT replica, beat FROM replicas ORDER BY replica");
      while (read.Next()) records.push_back({read.Text(0), read.Int(1)});
      return read.status();
    }));
    return records;
  }

  absl::Status Remove(const ReplicaRecord& record) override {
    return WriteInTransaction(db_, [&](Connection* db) {
      return Statement(db,
                       "DELETE FROM replicas WHERE replica = ?1 AND beat = ?2",
                       record.replica,
                       record.beat)
          .Run();
    });
  }

  absl::Status Remove(const std::string& replica) override {
    return WriteInTransaction(db_, [&](Connection* db) {
      return Statement(db, "DELETE FROM replicas WHERE replica = ?1", replica)
          .Run();
    });
  }

  absl::StatusOr<std::vector<std::string>> ListUnclaimed(int limit) override {
    std::vector<std::string> rigs;
    SELFCAL_RETURN_IF_ERROR(db_->ReadForService([&](Connection* db) {
      rigs.clear();
      Statement read(db,
                     WithUnscoredRigs() +
                         "SELECT id FROM rigs r WHERE rig IN "
                         "  (SELECT rig FROM unscored_rigs "
                         "   UNION SELECT rig FROM runs WHERE state IN (1, 2)) "
                         "AND " +
                         IsOwnRig("r.rig") +
                         " "
                         "AND NOT EXISTS (SELECT 1 FROM claims c "
                         "  JOIN replicas USING (replica) WHERE c.rig = r.rig) "
                         "LIMIT ?1",
                     limit);
      while (read.Next()) rigs.push_back(read.Text(0));
      return read.status();
    }));
    return rigs;
  }

  absl::StatusOr<std::vector<RigClaim>> ListBusy(
      const std::string& replica) override {
    std::vector<RigClaim> busy;
    SELFCAL_RETURN_IF_ERROR(db_->ReadForService([&](Connection* db) {
      busy.clear();
      Statement read(db,
                     "SELECT r.id, c.rig, c.number FROM claims c "
                     "JOIN rigs r ON r.rig = c.rig WHERE c.replica = ?1 "
                     "AND " +
                         IsOwnRig("c.rig") +
                         " "
                         "AND (EXISTS (SELECT 1 FROM segments s "
                         "       WHERE s.rig = c.rig AND s.state = 1) "
                         "  OR EXISTS (SELECT 1 FROM runs u "
                         "       WHERE u.rig = c.rig AND u.state IN (1, 2)))",
                     replica);
      while (read.Next())
        busy.emplace_back(read.Text(0), read.Int(1), read.Int(2));
      return read.status();
    }));
    return busy;
  }

  absl::StatusOr<std::optional<RigClaim>> Claim(
      const std::string& rig, const std::string& replica) override {
    std::optional<RigClaim> claimed;
    SELFCAL_RETURN_IF_ERROR(
        WriteInTransaction(db_, [&](Connection* db) -> absl::Status {
          claimed.reset();
          SELFCAL_ASSIGN_OR_RETURN(const std::int64_t row, LockRig(db, rig));
          SELFCAL_ASSIGN_OR_RETURN(const bool may, Exists(db, replica));
          if (!may) return NoRecord(replica);
          SELFCAL_ASSIGN_OR_RETURN(StoredClaim claim, ReadClaim(db, row));
          if (claim.replica != replica) {
            SELFCAL_ASSIGN_OR_RETURN(const bool is_held,
                                     Exists(db, claim.replica));
            if (is_held) return absl::OkStatus();
          }
          claim = {replica, claim.number + 1};
          SELFCAL_RETURN_IF_ERROR(WriteClaim(db, row, claim));
          claimed.emplace(rig, row, claim.number);
          return absl::OkStatus();
        }));
    return claimed;
  }

  absl::Status Release(const RigClaim& claim) override {
    return WriteInTransaction(db_, [&](Connection* db) -> absl::Status {
      SELFCAL_ASSIGN_OR_RETURN(const std::int64_t row, LockRig(db, claim.rig));
      SELFCAL_ASSIGN_OR_RETURN(const StoredClaim stored, ReadClaim(db, row));
      if (row != claim.key || stored.number != claim.number) {
        return absl::OkStatus();
      }
      return WriteClaim(db, row, {"", claim.number});
    });
  }

 private:
  Database* const db_;
};

}  // namespace

std::unique_ptr<Replicas> MakeReplicas(Database* database) {
  return std::make_unique<ReplicasOfDatabase>(database);
}

absl::Status CheckClaim(Connection* db,
                        std::int64_t rig_row,
                        const RigClaim& claim) {
  if (claim.number == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const StoredClaim stored, ReadClaim(db, rig_row));
  return rig_row == claim.key && stored.number == claim.number
             ? absl::OkStatus()
             : ClaimLost(claim);
}

}  // namespace selfcal::server
