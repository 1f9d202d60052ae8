#include "server/store/rigs.h"

#include <fmt/format.h>

#include <random>

#include "server/status/status_macros.h"
#include "server/store/announcements.h"
#include "server/store/checksum.h"
#include "server/store/driver/sql_condition.h"
#include "server/store/driver/statement.h"
#include "server/store/records.h"

namespace selfcal::server {
namespace {

absl::Status NoSuchRig(const std::string& rig) {
  return absl::NotFoundError(
      fmt::format("rig {} does not exist; create it first", rig));
}

constexpr char kRigColumns[] =
    "SELECT id, create_time_ns, definition, sha256 FROM rigs ";

absl::StatusOr<StoredRig> RigFromRow(const Statement& row) {
  const std::string what = "rig " + row.Text(0);
  const std::string bytes = row.Text(2);
  SELFCAL_RETURN_IF_ERROR(VerifySha256(bytes, row.Text(3), what));
  StoredRig stored;
  SELFCAL_ASSIGN_OR_RETURN(stored, ParseRig(bytes, what));
  stored.create_time_ns = row.Int(1);
  return stored;
}

// Reads the row id that `sql` selects for the rig.
absl::StatusOr<std::int64_t> FindRig(Connection* db,
                                     std::string_view sql,
                                     const std::string& rig) {
  Statement read(db, sql, rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) return NoSuchRig(rig);
  return read.Int(0);
}

// A positive key that no other daemon chooses: see decision 12.
std::int64_t NewKey() {
  std::random_device random;
  std::uniform_int_distribution<std::int64_t> keys(1, INT64_MAX);
  return keys(random);
}

absl::Status InsertLabels(Connection* db,
                          std::int64_t row,
                          const StoredRig& rig) {
  for (const auto& [name, value] : rig.labels) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(db,
                  "INSERT INTO rig_labels (rig, name, value) "
                  "VALUES (?1, ?2, ?3)",
                  row,
                  name,
                  value)
            .Run());
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::int64_t> InsertRig(Connection* db, const StoredRig& rig) {
  const std::string& id = rig.rig.id;
  const std::string bytes = SerializeRig(rig);
  const std::string sha256 = Sha256(bytes);
  for (;;) {
    // In one statement: another transaction may create the same rig.
    SELFCAL_ASSIGN_OR_RETURN(
        const std::int64_t row,
        InsertReturning(db,
                        "INSERT INTO rigs (rig, id, create_time_ns, "
                        "  definition, sha256) VALUES (?1, ?2, ?3, ?4, ?5) "
                        "ON CONFLICT DO NOTHING RETURNING rig",
                        NewKey(),
                        id,
                        rig.create_time_ns,
                        BlobView{bytes},
                        BlobView{sha256}));
    if (row != 0) {
      SELFCAL_RETURN_IF_ERROR(InsertLabels(db, row, rig));
      return row;
    }
    const absl::Status exists = FindRigId(db, id).status();
    if (exists.ok()) {
      return absl::AlreadyExistsError(
          fmt::format("rig {} exists; choose another name", id));
    }
    // Otherwise another rig has the key.
    if (!absl::IsNotFound(exists)) return exists;
  }
}

absl::Status WriteRig(UnitOfWork* tx, const StoredRig& rig) {
  tx->Changed(RecordKind::kRig);
  const std::string bytes = SerializeRig(rig);
  const std::string sha256 = Sha256(bytes);
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "UPDATE rigs SET definition = ?2, sha256 = ?3 WHERE rig = ?1",
                tx->rig_row(),
                BlobView{bytes},
                BlobView{sha256})
          .Run());
  return WriteLabels(tx, rig);
}

absl::Status WriteLabels(UnitOfWork* tx, const StoredRig& rig) {
  SELFCAL_RETURN_IF_ERROR(Statement(tx->db(),
                                    "DELETE FROM rig_labels WHERE rig = ?1",
                                    tx->rig_row())
                              .Run());
  return InsertLabels(tx->db(), tx->rig_row(), rig);
}

absl::Status DeleteRigRows(UnitOfWork* tx) {
  const auto run = [&](const std::string& sql) {
    return Statement(tx->db(), sql, tx->rig_row()).Run();
  };
  SELFCAL_RETURN_IF_ERROR(run("UPDATE rigs SET deleting = 1 WHERE rig = ?1"));
  // All that is left to report are its events, and that it is gone.
  SELFCAL_RETURN_IF_ERROR(
      run(fmt::format("DELETE FROM outbox WHERE rig = ?1 AND kind <> {}",
                      static_cast<int>(RecordKind::kEvent))));
  SELFCAL_RETURN_IF_ERROR(run("UPDATE uplinks SET deleted = 1 WHERE rig = ?1"));
  // Each before what it refers to.
  for (const char* table : {"table_absences",
                            "segment_scores",
                            "segment_information",
                            "segment_paths",
                            "payloads",
                            "segment_ends",
                            "table_entries",
                            "tables",
                            "disagreements",
                            "validations",
                            "activations",
                            "change_groups",
                            "changes",
                            "calibration_segments",
                            "estimates",
                            "calibrations",
                            "run_segments",
                            "runs",
                            "segments",
                            "claims",
                            "rig_labels",
                            "rig_name_suffixes",
                            "cohort_outliers",
                            "instructions",
                            "reported_rigs",
                            "rigs"}) {
    SELFCAL_RETURN_IF_ERROR(
        run(fmt::format("DELETE FROM {} WHERE rig = ?1", table)));
  }
  return AnnounceDeletion(tx);
}

absl::StatusOr<std::int64_t> FindRigId(Connection* db, const std::string& rig) {
  return FindRig(db, "SELECT rig FROM rigs WHERE id = ?1", rig);
}

absl::StatusOr<std::int64_t> LockRig(Connection* db, const std::string& rig) {
  return FindRig(db,
                 fmt::format("SELECT rig FROM rigs WHERE id = ?1{}",
                             db->dialect().for_update),
                 rig);
}

absl::StatusOr<StoredRig> ReadRig(Connection* db, const std::string& rig) {
  Statement read(db, std::string(kRigColumns) + "WHERE id = ?1", rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return NoSuchRig(rig);
  }
  return RigFromRow(read);
}

absl::StatusOr<std::map<std::string, StoredRig>> ReadRigs(
    Connection* db, const std::set<std::string>& names) {
  std::map<std::string, StoredRig> rigs;
  if (names.empty()) return rigs;
  SqlCondition condition;
  condition.AndOneOf("id", names);
  Statement read(
      db, condition.reuse(), kRigColumns + ("WHERE " + condition.sql()));
  condition.Bind(&read);
  while (read.Next()) {
    SELFCAL_ASSIGN_OR_RETURN(rigs[read.Text(0)], RigFromRow(read));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return rigs;
}

absl::StatusOr<std::map<std::string, std::int64_t>> ReadRigKeys(
    Connection* db, const std::set<std::string>& names) {
  std::map<std::string, std::int64_t> keys;
  if (names.empty()) return keys;
  SqlCondition condition;
  condition.AndOneOf("id", names);
  Statement read(db,
                 condition.reuse(),
                 "SELECT id, rig FROM rigs WHERE " + condition.sql());
  condition.Bind(&read);
  while (read.Next()) keys[read.Text(0)] = read.Int(1);
  SELFCAL_RETURN_IF_ERROR(read.status());
  return keys;
}

absl::StatusOr<StoredRig> ReadRig(UnitOfWork* tx) {
  return ReadRig(tx->db(), tx->rig());
}

absl::Status WriteAlarms(UnitOfWork* tx, std::int64_t alarms) {
  return Statement(tx->db(),
                   "UPDATE rigs SET alarms = ?2 "
                   "WHERE rig = ?1 AND alarms <> ?2",
                   tx->rig_row(),
                   alarms)
      .Run();
}

absl::Status RaiseSilent(Connection* db,
                         std::int64_t before_ns,
                         std::int64_t alarms) {
  return Statement(db,
                   "UPDATE rigs SET alarms = alarms | ?2 "
                   "WHERE rig IN (SELECT rig FROM reported_rigs "
                   "  WHERE time_ns < ?1) AND (alarms & ?2) <> ?2",
                   before_ns,
                   alarms)
      .Run();
}

absl::StatusOr<std::int64_t> CountRigs(UnitOfWork* tx) {
  return ReadInt(tx->db(), "SELECT count(*) FROM rigs");
}

}  // namespace selfcal::server
