// How a version of a calibration is written, judged and found wrong.
#include <fmt/format.h>

#include "server/store/calibration_states.h"
#include "server/store/calibrations.h"
#include "server/store/changes.h"
#include "server/store/checksum.h"
#include "server/store/clock.h"
#include "server/store/events.h"
#include "server/store/records.h"
#include "server/store/rigs.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

absl::Status InsertContent(Connection* db,
                           std::int64_t rig,
                           const StoredCalibration& calibration) {
  const std::string content = SerializeCalibration(calibration);
  const std::string sha256 = Sha256(content);
  // A version that no run produced has run 0 here, which becomes NULL.
  return Statement(
             db,
             "INSERT INTO calibrations (rig, version, state, create_time_ns, "
             "  run, content, sha256) "
             "VALUES (?1, ?2, ?3, ?4, nullif(?5, 0), ?6, ?7)",
             rig,
             calibration.version,
             static_cast<int>(calibration.state) + 1,
             calibration.create_time_ns,
             calibration.run.value_or(0),
             BlobView{content},
             BlobView{sha256})
      .Run();
}

absl::Status InsertValidation(Connection* db,
                              std::int64_t rig,
                              const StoredCalibration& judged) {
  const std::string content = SerializeValidation(judged);
  const std::string sha256 = Sha256(content);
  return Statement(db,
                   "INSERT INTO validations (rig, version, content, sha256) "
                   "VALUES (?1, ?2, ?3, ?4)",
                   rig,
                   judged.version,
                   BlobView{content},
                   BlobView{sha256})
      .Run();
}

absl::Status AppendPublished(Connection* db,
                             const StoredCalibration& calibration) {
  return AppendEvent(db,
                     calibration.rig,
                     EventKind::kCalibrationPublished,
                     fmt::format("version {}", calibration.version));
}

}  // namespace

absl::Status InsertFactory(Connection* db,
                           std::int64_t rig,
                           const StoredCalibration& calibration) {
  SELFCAL_RETURN_IF_ERROR(InsertCalibration(db, rig, calibration));
  SELFCAL_RETURN_IF_ERROR(InsertActivation(db, rig, calibration.version));
  return AppendPublished(db, calibration);
}

absl::Status InsertCalibration(Connection* db,
                               std::int64_t rig,
                               const StoredCalibration& calibration) {
  SELFCAL_RETURN_IF_ERROR(InsertContent(db, rig, calibration));
  for (const SegmentKey& key : calibration.segments) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(db,
                  "INSERT INTO calibration_segments (rig, version, segment) "
                  "SELECT ?1, ?2, segment FROM segments "
                  "WHERE rig = ?1 AND session = ?3 AND session_index = ?4",
                  rig,
                  calibration.version,
                  key.session,
                  key.index)
            .Run());
  }
  return absl::OkStatus();
}

absl::Status JudgeCandidate(Connection* db,
                            std::int64_t rig,
                            const StoredCalibration& judged) {
  SELFCAL_RETURN_IF_ERROR(InsertValidation(db, rig, judged));
  if (judged.state == CalibrationState::kActive) {
    SELFCAL_RETURN_IF_ERROR(MakeActive(db,
                                       rig,
                                       judged.version,
                                       CalibrationState::kCandidate,
                                       CalibrationState::kSuperseded));
    return AppendPublished(db, judged);
  }
  SELFCAL_RETURN_IF_ERROR(ChangeState(
      db, rig, judged.version, CalibrationState::kCandidate, judged.state));
  return AppendEvent(
      db,
      judged.rig,
      EventKind::kCalibrationRejected,
      fmt::format(
          "version {}: {}", judged.version, fmt::join(judged.reasons, " ")));
}

absl::StatusOr<StoredCalibration> ActivateCalibrationRow(
    Connection* db,
    const std::string& rig,
    std::int64_t version,
    const std::string& caller,
    const std::string& reason) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration chosen,
                           ReadCalibration(db, rig, version));
  if (chosen.state == CalibrationState::kActive) {
    return chosen;
  }
  if (chosen.state == CalibrationState::kCandidate) {
    return absl::FailedPreconditionError(fmt::format(
        "calibration {} of rig {} is not validated yet; wait for its run",
        version,
        rig));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active,
                           ActiveVersion(db, rig_id));
  const bool back = version < active;
  SELFCAL_RETURN_IF_ERROR(MakeActive(
      db,
      rig_id,
      version,
      chosen.state,
      back ? CalibrationState::kRolledBack : CalibrationState::kSuperseded));
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(db,
                  rig,
                  back ? EventKind::kCalibrationRolledBack
                       : EventKind::kCalibrationActivated,
                  fmt::format("version {} in place of {} by {}: {}",
                              version,
                              active,
                              caller,
                              reason)));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration activated,
                           ReadCalibration(db, rig, version));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return activated;
}

absl::Status ReportDisagreementRow(Connection* db,
                                   const std::string& rig,
                                   std::int64_t version,
                                   const std::string& finding) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_RETURN_IF_ERROR(ReadCalibration(db, rig, version).status());
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                "INSERT INTO disagreements (rig, version, time_ns, finding) "
                "VALUES (?1, ?2, ?3, ?4) ON CONFLICT DO NOTHING",
                rig_id,
                version,
                NowNs(),
                finding)
          .Run());
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(db,
                  rig,
                  EventKind::kCoresDisagree,
                  fmt::format("version {}: {}", version, finding)));
  return transaction.Commit();
}

}  // namespace selfcal::server
