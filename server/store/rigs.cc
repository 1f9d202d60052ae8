#include "server/store/rigs.h"

#include <fmt/format.h>

#include "server/store/calibrations.h"
#include "server/store/checksum.h"
#include "server/store/clock.h"
#include "server/store/events.h"
#include "server/store/paging.h"
#include "server/store/records.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

constexpr char kList[] = "rigs";

absl::Status NoSuchRig(const std::string& rig) {
  return absl::NotFoundError(
      fmt::format("rig {} does not exist; create it first", rig));
}

// From columns id, create_time_ns, definition, sha256, starting at `column`.
absl::StatusOr<StoredRig> RigFromRow(const Statement& row, int column) {
  const std::string what = "rig " + row.Text(column);
  const std::string bytes = row.Text(column + 2);
  SELFCAL_RETURN_IF_ERROR(VerifySha256(bytes, row.Text(column + 3), what));
  StoredRig stored;
  SELFCAL_ASSIGN_OR_RETURN(stored, ParseRig(bytes, what));
  stored.create_time_ns = row.Int(column + 1);
  return stored;
}

// What is known of the factory's calibration are its tolerances.
StoredCalibration FactoryCalibration(const Rig& rig) {
  Eigen::VectorXd variances = Eigen::VectorXd::Zero(TangentSize(rig.factory));
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  for (const int component : FreeComponents(rig)) {
    variances[component] = sigmas[component] * sigmas[component];
  }
  StoredCalibration calibration;
  calibration.rig = rig.id;
  calibration.version = 1;
  calibration.state = CalibrationState::kActive;
  calibration.theta = rig.factory;
  calibration.covariance = variances.asDiagonal();
  return calibration;
}

}  // namespace

absl::StatusOr<StoredRig> CreateRigRow(Connection* db,
                                       const Rig& rig,
                                       const RigPolicy& policy) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  Statement existing(db, "SELECT 1 FROM rigs WHERE id = ?1", rig.id);
  const bool exists = existing.Next();
  SELFCAL_RETURN_IF_ERROR(existing.status());
  if (exists) {
    return absl::AlreadyExistsError(
        fmt::format("rig {} exists; choose another name", rig.id));
  }
  StoredRig stored{rig, NowNs(), policy};
  const std::string bytes = SerializeRig(stored);
  const std::string sha256 = Sha256(bytes);
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                "INSERT INTO rigs (id, create_time_ns, definition, sha256) "
                "VALUES (?1, ?2, ?3, ?4)",
                rig.id,
                stored.create_time_ns,
                BlobView{bytes},
                BlobView{sha256})
          .Run());
  const std::int64_t rowid = sqlite3_last_insert_rowid(db->handle());
  SELFCAL_RETURN_IF_ERROR(InsertTables(db, rowid, MakeTables(rig)));
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(db, rig.id, EventKind::kRigCreated, "created"));
  StoredCalibration factory = FactoryCalibration(rig);
  factory.create_time_ns = stored.create_time_ns;
  SELFCAL_RETURN_IF_ERROR(InsertFactory(db, rowid, factory));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return stored;
}

absl::StatusOr<std::int64_t> FindRigId(Connection* db, const std::string& rig) {
  Statement read(db, "SELECT rig FROM rigs WHERE id = ?1", rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return NoSuchRig(rig);
  }
  return read.Int(0);
}

absl::StatusOr<RigRow> ReadRig(Connection* db, const std::string& rig) {
  Statement read(db,
                 "SELECT rig, id, create_time_ns, definition, sha256 "
                 "FROM rigs WHERE id = ?1",
                 rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return NoSuchRig(rig);
  }
  RigRow row;
  row.rowid = read.Int(0);
  SELFCAL_ASSIGN_OR_RETURN(row.stored, RigFromRow(read, 1));
  return row;
}

absl::StatusOr<Listed<StoredRig>> ListRigRows(Connection* db,
                                              const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto after, PageKey(kList, page));
  const int size = PageSize(page);
  Statement read(db,
                 "SELECT id, create_time_ns, definition, sha256 "
                 "FROM rigs WHERE id > ?1 ORDER BY id LIMIT ?2",
                 after.value_or(""),
                 size + 1);
  Listed<StoredRig> listed;
  while (read.Next()) {
    SELFCAL_ASSIGN_OR_RETURN(StoredRig stored, RigFromRow(read, 0));
    listed.items.push_back(std::move(stored));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  CutPage(
      kList, size, [](const auto& item) { return item.rig.id; }, &listed);
  return listed;
}

}  // namespace selfcal::server
