#include "server/store/outbox.h"

#include <fmt/format.h>

#include <climits>
#include <utility>

#include "selfcal/store/report.pb.h"
#include "server/status/status_macros.h"
#include "server/store/driver/driver.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/inventory.h"
#include "server/store/own_rig.h"
#include "server/store/reported_rows.h"
#include "server/store/rigs.h"

namespace selfcal::server {
namespace {

constexpr int kData = static_cast<int>(RecordKind::kData);

// More than this do not go into one report, however small they are.
constexpr int kMaxEntries = 500;

absl::Status Put(UnitOfWork* tx, RecordKind kind, std::int64_t number) {
  // A place is not given again when its note is gone: the confirmation of a
  // report that is under way would remove the new note.
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t place,
      InsertReturning(tx->db(),
                      "UPDATE uplinks SET place = place + 1 WHERE rig = ?1 "
                      "RETURNING place",
                      tx->rig_row()));
  return Statement(tx->db(),
                   "INSERT INTO outbox (rig, place, kind, number, revision) "
                   "VALUES (?1, ?2, ?3, ?4, 1) "
                   "ON CONFLICT (rig, kind, number) "
                   "DO UPDATE SET revision = outbox.revision + 1",
                   tx->rig_row(),
                   place,
                   static_cast<int>(kind),
                   number)
      .Run();
}

// Puts all records of a kind into the outbox.
absl::Status PutAll(UnitOfWork* tx, RecordKind kind) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::int64_t> numbers,
                           NumbersOf(tx, kind));
  for (const std::int64_t number : numbers) {
    SELFCAL_RETURN_IF_ERROR(Put(tx, kind, number));
  }
  return absl::OkStatus();
}

// Puts versions and activations into the outbox: each version before the next
// one, with the activations until it was first active, as a rig has one
// candidate at most.
absl::Status PutCalibrations(UnitOfWork* tx) {
  struct Version {
    std::int64_t version;
    std::int64_t first_activation;  // 0: none
  };
  std::vector<Version> versions;
  Statement read(tx->db(),
                 "SELECT version, coalesce((SELECT min(a.activation) "
                 "  FROM activations a WHERE a.rig = c.rig "
                 "  AND a.version = c.version), 0) "
                 "FROM calibrations c WHERE rig = ?1 ORDER BY version",
                 tx->rig_row());
  while (read.Next()) versions.push_back({read.Int(0), read.Int(1)});
  SELFCAL_RETURN_IF_ERROR(read.status());
  std::int64_t next = 1;
  for (const Version& version : versions) {
    SELFCAL_RETURN_IF_ERROR(Put(tx, RecordKind::kCalibration, version.version));
    for (; next <= version.first_activation; ++next) {
      SELFCAL_RETURN_IF_ERROR(Put(tx, RecordKind::kActivation, next));
    }
  }
  return PutAll(tx, RecordKind::kActivation);
}

absl::Status PutEverything(UnitOfWork* tx, bool with_data) {
  for (const RecordKind kind : {RecordKind::kRig,
                                RecordKind::kTables,
                                RecordKind::kSegment,
                                RecordKind::kRun}) {
    SELFCAL_RETURN_IF_ERROR(PutAll(tx, kind));
  }
  SELFCAL_RETURN_IF_ERROR(PutCalibrations(tx));
  SELFCAL_RETURN_IF_ERROR(PutAll(tx, RecordKind::kChange));
  SELFCAL_RETURN_IF_ERROR(PutAll(tx, RecordKind::kEvent));
  if (with_data) SELFCAL_RETURN_IF_ERROR(PutAll(tx, RecordKind::kData));
  return PutAll(tx, RecordKind::kInventory);
}

class OutboxOfDatabase final : public Outbox {
 public:
  explicit OutboxOfDatabase(Database* db) : db_(db) {}

  absl::StatusOr<std::vector<std::string>> ListUnreported() override {
    std::vector<std::string> rigs;
    SELFCAL_RETURN_IF_ERROR(db_->Read([&](Connection* db) {
      rigs.clear();
      Statement read(db,
                     "SELECT id FROM rigs r WHERE NOT EXISTS "
                     "  (SELECT 1 FROM uplinks u WHERE u.rig = r.rig) AND " +
                         IsOwnRig("r.rig") + " ORDER BY id");
      while (read.Next()) rigs.push_back(read.Text(0));
      return read.status();
    }));
    return rigs;
  }

  absl::StatusOr<std::vector<ReportedRig>> List() override {
    std::vector<ReportedRig> rigs;
    SELFCAL_RETURN_IF_ERROR(db_->Read([&](Connection* db) {
      rigs.clear();
      Statement read(db,
                     "SELECT u.id, u.rig, u.report, u.time_ns, u.deleted, "
                     "  (SELECT count(*) FROM outbox o WHERE o.rig = u.rig) "
                     "FROM uplinks u ORDER BY u.deleted DESC, u.id");
      while (read.Next()) {
        rigs.push_back({read.Text(0),
                        read.Int(1),
                        read.Int(2),
                        read.Int(3),
                        read.Int(4) != 0,
                        read.Int(5)});
      }
      return read.status();
    }));
    return rigs;
  }

  absl::Status BeginAnew(const std::string& rig, ReportedData data) override {
    return WriteInTransaction(db_, [&](Connection* db) -> absl::Status {
      SELFCAL_ASSIGN_OR_RETURN(const std::int64_t row, LockRig(db, rig));
      UnitOfWork tx(db, rig, row, 0);
      SELFCAL_RETURN_IF_ERROR(
          Statement(db, "DELETE FROM outbox WHERE rig = ?1", row).Run());
      SELFCAL_RETURN_IF_ERROR(
          Statement(db,
                    "INSERT INTO uplinks (rig, id, data) VALUES (?1, ?2, ?3) "
                    "ON CONFLICT (rig) DO UPDATE SET report = 0, data = ?3",
                    row,
                    rig,
                    static_cast<int>(data))
              .Run());
      return PutEverything(&tx, data != ReportedData::kNone);
    });
  }

  absl::Status SetData(ReportedData data) override {
    return WriteInTransaction(db_, [&](Connection* db) {
      return Statement(
                 db, "UPDATE uplinks SET data = ?1", static_cast<int>(data))
          .Run();
    });
  }

  absl::StatusOr<Report> Next(const ReportedRig& rig,
                              std::int64_t max_bytes) override {
    // Before its records are read: those of a later attempt are newer.
    std::int64_t attempt = 0;
    SELFCAL_RETURN_IF_ERROR(
        WriteInTransaction(db_, [&](Connection* db) -> absl::Status {
          SELFCAL_ASSIGN_OR_RETURN(
              attempt,
              InsertReturning(db,
                              "UPDATE uplinks SET attempt = attempt + 1 "
                              "WHERE rig = ?1 RETURNING attempt",
                              rig.key));
          return absl::OkStatus();
        }));
    Report report;
    SELFCAL_RETURN_IF_ERROR(db_->Read([&](Connection* db) -> absl::Status {
      report = Report();
      report.rig = rig.rig;
      report.key = rig.key;
      report.number = rig.report + 1;
      report.attempt = attempt;
      report.deleted = rig.deleted;
      UnitOfWork tx(db, rig.rig, rig.key, 0);
      return Fill(&tx, max_bytes, &report);
    }));
    return report;
  }

  absl::Status FollowAttempt(const ReportedRig& rig,
                             std::int64_t attempt) override {
    return WriteInTransaction(db_, [&](Connection* db) {
      return Statement(db,
                       "UPDATE uplinks SET attempt = ?2 "
                       "WHERE rig = ?1 AND attempt < ?2",
                       rig.key,
                       attempt)
          .Run();
    });
  }

  absl::Status Confirm(const Report& report, std::int64_t time_ns) override {
    return WriteInTransaction(db_, [&](Connection* db) -> absl::Status {
      for (const Report::Entry& entry : report.entries) {
        SELFCAL_RETURN_IF_ERROR(
            Statement(db,
                      "DELETE FROM outbox WHERE rig = ?1 AND place = ?2 "
                      "AND revision = ?3",
                      report.key,
                      entry.place,
                      entry.revision)
                .Run());
      }
      if (report.deleted) {
        return Statement(db, "DELETE FROM uplinks WHERE rig = ?1", report.key)
            .Run();
      }
      return Statement(db,
                       "UPDATE uplinks SET report = ?2, time_ns = ?3 "
                       "WHERE rig = ?1 AND report = ?2 - 1",
                       report.key,
                       report.number,
                       time_ns)
          .Run();
    });
  }

  absl::Status Close() override {
    return WriteInTransaction(db_, [&](Connection* db) -> absl::Status {
      SELFCAL_RETURN_IF_ERROR(Statement(db, "DELETE FROM outbox").Run());
      return Statement(db, "DELETE FROM uplinks").Run();
    });
  }

 private:
  // Reads the records with which the outbox begins; of a rig that was deleted,
  // all of them, which are events.
  static absl::Status Fill(UnitOfWork* tx,
                           std::int64_t max_bytes,
                           Report* report) {
    struct Waiting {
      Report::Entry entry;
      RecordKind kind;
      std::int64_t number;
    };
    std::vector<Waiting> all;
    Statement read(tx->db(),
                   "SELECT place, revision, kind, number FROM outbox "
                   "WHERE rig = ?1 ORDER BY place LIMIT ?2",
                   tx->rig_row(),
                   report->deleted ? INT_MAX : kMaxEntries);
    while (read.Next()) {
      all.push_back({{read.Int(0), read.Int(1)},
                     static_cast<RecordKind>(read.Int(2)),
                     read.Int(3)});
    }
    SELFCAL_RETURN_IF_ERROR(read.status());
    store::ReportedRecords records;
    PutTables(&records);
    std::int64_t bytes = 0;
    for (const Waiting& waiting : all) {
      SELFCAL_RETURN_IF_ERROR(
          waiting.kind == RecordKind::kInventory
              ? PutInventory(tx, &records)
              : PutRecord(tx, waiting.kind, waiting.number, &records));
      const auto size = static_cast<std::int64_t>(
          records.records(records.records_size() - 1).ByteSizeLong());
      if (!report->deleted && bytes > 0 && bytes + size > max_bytes) {
        records.mutable_records()->RemoveLast();
        break;
      }
      bytes += size;
      report->entries.push_back(waiting.entry);
    }
    if (!all.empty()) report->records = records.SerializeAsString();
    SELFCAL_ASSIGN_OR_RETURN(
        const std::int64_t waiting,
        ReadInt(tx->db(),
                "SELECT count(*) FROM outbox WHERE rig = ?1",
                tx->rig_row()));
    report->waiting =
        waiting - static_cast<std::int64_t>(report->entries.size());
    return absl::OkStatus();
  }

  Database* const db_;
};

}  // namespace

std::unique_ptr<Outbox> MakeOutbox(Database* database) {
  return std::make_unique<OutboxOfDatabase>(database);
}

absl::Status NoteChanges(UnitOfWork* tx) {
  if (tx->changed().empty()) return absl::OkStatus();
  Statement read(
      tx->db(), "SELECT deleted FROM uplinks WHERE rig = ?1", tx->rig_row());
  const bool is_reported = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!is_reported) return absl::OkStatus();
  const bool is_deleted = read.Int(0) != 0;
  for (const auto& [kind, number] : tx->changed()) {
    if (is_deleted && kind != RecordKind::kEvent) continue;
    SELFCAL_RETURN_IF_ERROR(Put(tx, kind, number));
  }
  return absl::OkStatus();
}

absl::StatusOr<ReportedData> ReportedDataOf(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t data,
      ReadInt(
          tx->db(), "SELECT data FROM uplinks WHERE rig = ?1", tx->rig_row()));
  return static_cast<ReportedData>(data);
}

absl::StatusOr<WaitingData> DataInOutbox(UnitOfWork* tx) {
  Statement read(tx->db(),
                 "SELECT count(*), coalesce(sum(length(p.data)), 0) "
                 "FROM outbox o CROSS JOIN payloads p "
                 "WHERE p.rig = o.rig AND p.sequence = o.number "
                 "AND o.rig = ?1 AND o.kind = ?2",
                 tx->rig_row(),
                 kData);
  WaitingData waiting;
  if (read.Next()) waiting = {read.Int(0), read.Int(1)};
  SELFCAL_RETURN_IF_ERROR(read.status());
  return waiting;
}

absl::StatusOr<std::int64_t> DropOldestData(UnitOfWork* tx) {
  return InsertReturning(tx->db(),
                         "DELETE FROM outbox WHERE rig = ?1 AND kind = ?2 "
                         "AND number = (SELECT min(number) FROM outbox "
                         "  WHERE rig = ?1 AND kind = ?2) RETURNING number",
                         tx->rig_row(),
                         kData);
}

}  // namespace selfcal::server
