// Writes calibration versions.
#include <optional>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/announcements.h"
#include "server/store/calibration_rows.h"
#include "server/store/calibrations.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/estimates.h"
#include "server/store/records.h"

namespace selfcal::server {
namespace {

absl::Status InsertContent(UnitOfWork* tx,
                           const StoredCalibration& calibration) {
  const std::string content = SerializeCalibration(calibration);
  const std::string sha256 = Sha256(content);
  return Statement(
             tx->db(),
             "INSERT INTO calibrations (rig, version, state, create_time_ns, "
             "  run, content, sha256, create_steady_ns) "
             "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
             tx->rig_row(),
             calibration.version,
             static_cast<int>(calibration.state),
             calibration.create_time_ns,
             calibration.run,
             BlobView{content},
             BlobView{sha256},
             calibration.create_steady_ns)
      .Run();
}

// The columns of a version that was inserted with its segments.
absl::Status WriteFirstListColumns(UnitOfWork* tx, std::int64_t version) {
  std::vector<StoredCalibration> inserted(1);
  inserted.front().rig_key = tx->rig_row();
  inserted.front().version = version;
  SELFCAL_RETURN_IF_ERROR(ReadOrigins(tx->db(), &inserted));
  return WriteListColumns(tx, inserted.front());
}

}  // namespace

absl::Status InsertCalibration(UnitOfWork* tx,
                               const StoredCalibration& calibration) {
  tx->Changed(RecordKind::kCalibration, calibration.version);
  SELFCAL_RETURN_IF_ERROR(InsertContent(tx, calibration));
  for (const SegmentKey& key : calibration.segments) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(tx->db(),
                  "INSERT INTO calibration_segments (rig, version, sequence) "
                  "SELECT rig, ?2, sequence FROM segments "
                  "WHERE rig = ?1 AND session = ?3 AND session_index = ?4",
                  tx->rig_row(),
                  calibration.version,
                  key.session,
                  key.index)
            .Run());
  }
  SELFCAL_RETURN_IF_ERROR(WriteFirstListColumns(tx, calibration.version));
  return InsertEstimates(tx, calibration);
}

absl::Status WriteListColumns(UnitOfWork* tx,
                              const StoredCalibration& calibration) {
  std::optional<double> temperature_c;
  if (calibration.temperatures) {
    temperature_c = calibration.temperatures->mean_c;
  }
  return Statement(tx->db(),
                   "UPDATE calibrations SET validated = ?3, temperature_c = ?4 "
                   "WHERE rig = ?1 AND version = ?2",
                   tx->rig_row(),
                   calibration.version,
                   static_cast<int>(calibration.verdict.kind),
                   temperature_c)
      .Run();
}

absl::Status InsertValidation(UnitOfWork* tx,
                              const StoredCalibration& calibration) {
  tx->Changed(RecordKind::kCalibration, calibration.version);
  const std::string content = SerializeValidation(calibration);
  const std::string sha256 = Sha256(content);
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "INSERT INTO validations (rig, version, content, sha256) "
                "VALUES (?1, ?2, ?3, ?4)",
                tx->rig_row(),
                calibration.version,
                BlobView{content},
                BlobView{sha256})
          .Run());
  return Statement(tx->db(),
                   "UPDATE calibrations SET validated = ?3 "
                   "WHERE rig = ?1 AND version = ?2",
                   tx->rig_row(),
                   calibration.version,
                   static_cast<int>(calibration.verdict.kind))
      .Run();
}

absl::Status WriteState(UnitOfWork* tx,
                        std::int64_t version,
                        CalibrationState from,
                        CalibrationState to) {
  tx->Changed(RecordKind::kCalibration, version);
  return Statement(tx->db(),
                   "UPDATE calibrations SET state = ?4 "
                   "WHERE rig = ?1 AND version = ?2 AND state = ?3",
                   tx->rig_row(),
                   version,
                   static_cast<int>(from),
                   static_cast<int>(to))
      .Run();
}

absl::Status InsertActivation(UnitOfWork* tx, std::int64_t version) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t activation,
      InsertReturning(tx->db(),
                      "INSERT INTO activations (rig, activation, version, "
                      "  time_ns, steady_ns) "
                      "VALUES (?1, (SELECT coalesce(max(activation), 0) + 1 "
                      "  FROM activations WHERE rig = ?1), ?2, ?3, ?4) "
                      "RETURNING activation",
                      tx->rig_row(),
                      version,
                      tx->time_ns(),
                      tx->now().steady_ns));
  tx->Changed(RecordKind::kActivation, activation);
  return AnnounceCalibration(tx);
}

absl::Status InsertFinding(UnitOfWork* tx,
                           std::int64_t version,
                           const std::string& finding) {
  tx->Changed(RecordKind::kCalibration, version);
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "INSERT INTO disagreements (rig, version, time_ns, finding) "
                "VALUES (?1, ?2, ?3, ?4) ON CONFLICT DO NOTHING",
                tx->rig_row(),
                version,
                tx->time_ns(),
                finding)
          .Run());
  return AnnounceCalibration(tx);
}

}  // namespace selfcal::server
