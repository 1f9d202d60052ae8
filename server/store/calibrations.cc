#include "server/store/calibrations.h"

#include <fmt/format.h>

#include <cstdint>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/calibration_rows.h"
#include "server/store/driver/statement.h"
#include "server/store/records.h"
#include "server/store/rigs.h"

namespace selfcal::server {
namespace {

absl::StatusOr<std::int64_t> ActiveVersionOf(Connection* db, std::int64_t rig) {
  Statement read(
      db, "SELECT version FROM calibrations WHERE rig = ?1 AND state = 1", rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return absl::DataLossError(
        "the rig has no active calibration; restore the database from a "
        "backup");
  }
  return read.Int(0);
}

absl::Status NoSuchCalibration(const std::string& rig, std::int64_t version) {
  return absl::NotFoundError(
      fmt::format("rig {} has no calibration {}", rig, version));
}

}  // namespace

absl::StatusOr<StoredCalibration> ReadCalibration(Connection* db,
                                                  const std::string& rig,
                                                  std::int64_t version) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(db,
                 SelectCalibrations() + "WHERE c.rig = ?1 AND c.version = ?2",
                 rig_id,
                 version);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) return NoSuchCalibration(rig, version);
  std::vector<StoredCalibration> one(1);
  SELFCAL_ASSIGN_OR_RETURN(one.front(),
                           CalibrationFromRow(read, ParseCalibration));
  SELFCAL_RETURN_IF_ERROR(ReadOrigins(db, &one));
  return std::move(one.front());
}

absl::StatusOr<StoredCalibration> ReadActiveCalibration(
    Connection* db, const std::string& rig) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t version,
                           ActiveVersionOf(db, rig_id));
  return ReadCalibration(db, rig, version);
}

absl::StatusOr<bool> WasActive(Connection* db,
                               const std::string& rig,
                               std::int64_t version) {
  Statement read(db,
                 "SELECT EXISTS (SELECT 1 FROM activations a "
                 "  WHERE a.rig = c.rig AND a.version = c.version) "
                 "FROM calibrations c JOIN rigs r ON r.rig = c.rig "
                 "WHERE r.id = ?1 AND c.version = ?2",
                 rig,
                 version);
  if (read.Next()) return read.Int(0) != 0;
  SELFCAL_RETURN_IF_ERROR(read.status());
  return NoSuchCalibration(rig, version);
}

absl::StatusOr<std::optional<std::int64_t>> CandidateOfRun(Connection* db,
                                                           std::int64_t rig,
                                                           std::int64_t run) {
  Statement read(db,
                 "SELECT version FROM calibrations "
                 "WHERE rig = ?1 AND run = ?2 AND state = 4",
                 rig,
                 run);
  std::optional<std::int64_t> version;
  if (read.Next()) {
    version = read.Int(0);
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return version;
}

absl::StatusOr<StoredCalibration> CandidateCalibration(Connection* db,
                                                       const std::string& rig,
                                                       std::int64_t run) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const auto version, CandidateOfRun(db, rig_id, run));
  if (!version) {
    return absl::NotFoundError(
        fmt::format("recalibration {} of rig {} has no candidate", run, rig));
  }
  return ReadCalibration(db, rig, *version);
}

absl::StatusOr<StoredCalibration> ReadCalibration(UnitOfWork* tx,
                                                  std::int64_t version) {
  return ReadCalibration(tx->db(), tx->rig(), version);
}

absl::StatusOr<StoredCalibration> ReadActiveCalibration(UnitOfWork* tx) {
  return ReadActiveCalibration(tx->db(), tx->rig());
}

absl::StatusOr<std::int64_t> ActiveVersion(UnitOfWork* tx) {
  return ActiveVersionOf(tx->db(), tx->rig_row());
}

absl::StatusOr<std::int64_t> NextVersion(UnitOfWork* tx) {
  return ReadInt(tx->db(),
                 "SELECT coalesce(max(version), 0) + 1 FROM calibrations "
                 "WHERE rig = ?1",
                 tx->rig_row());
}

absl::StatusOr<std::optional<std::int64_t>> CandidateOfRun(UnitOfWork* tx,
                                                           std::int64_t run) {
  return CandidateOfRun(tx->db(), tx->rig_row(), run);
}

absl::StatusOr<std::int64_t> ActivationSteadyTime(UnitOfWork* tx,
                                                  std::int64_t activation) {
  return ReadInt(tx->db(),
                 "SELECT steady_ns FROM activations "
                 "WHERE rig = ?1 AND activation = ?2",
                 tx->rig_row(),
                 activation);
}

absl::StatusOr<std::int64_t> SchemaVersion(UnitOfWork* tx) {
  return ReadInt(tx->db(), "SELECT max(version) FROM schema_migrations");
}

}  // namespace selfcal::server
