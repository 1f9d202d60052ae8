#include "server/store/calibrations.h"

#include <fmt/format.h>

#include <cstdint>

#include "server/store/checksum.h"
#include "server/store/events.h"
#include "server/store/paging.h"
#include "server/store/records.h"
#include "server/store/rigs.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

constexpr char kColumns[] =
    "SELECT version, state, create_time_ns, run, content, sha256 "
    "FROM calibrations ";

absl::Status ReadSegmentKeys(Connection* db,
                             std::int64_t rig,
                             StoredCalibration* calibration) {
  Statement read(db,
                 "SELECT s.session, s.session_index FROM calibration_segments "
                 "c JOIN segments s USING (segment) "
                 "WHERE c.rig = ?1 AND c.version = ?2 ORDER BY s.sequence",
                 rig,
                 calibration->version);
  while (read.Next()) {
    calibration->segments.push_back({read.Text(0), read.Int(1)});
  }
  return read.status();
}

absl::StatusOr<StoredCalibration> CalibrationFromRow(Connection* db,
                                                     const Statement& row,
                                                     std::int64_t rig_id,
                                                     const std::string& rig) {
  const std::int64_t version = row.Int(0);
  const std::string what =
      fmt::format("calibration {} of rig {}", version, rig);
  const std::string content = row.Text(4);
  SELFCAL_RETURN_IF_ERROR(VerifySha256(content, row.Text(5), what));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration calibration,
                           ParseCalibration(content, what));
  if (calibration.rig != rig || calibration.version != version) {
    return absl::DataLossError(fmt::format(
        "{} holds the content of another version; restore a backup", what));
  }
  calibration.state = static_cast<CalibrationState>(row.Int(1) - 1);
  calibration.create_time_ns = row.Int(2);
  if (!row.IsNull(3)) {
    calibration.run = row.Int(3);
  }
  SELFCAL_RETURN_IF_ERROR(ReadSegmentKeys(db, rig_id, &calibration));
  return calibration;
}

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

absl::Status AppendCalibrationEvent(Connection* db,
                                    const StoredCalibration& calibration) {
  if (calibration.state == CalibrationState::kRejected) {
    return AppendEvent(db,
                       calibration.rig,
                       EventKind::kCalibrationRejected,
                       fmt::format("version {}: {}",
                                   calibration.version,
                                   fmt::join(calibration.reasons, "; ")));
  }
  return AppendEvent(db,
                     calibration.rig,
                     EventKind::kCalibrationPublished,
                     fmt::format("version {}", calibration.version));
}

}  // namespace

absl::StatusOr<StoredCalibration> ReadCalibration(Connection* db,
                                                  const std::string& rig,
                                                  std::int64_t version) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(db,
                 std::string(kColumns) + "WHERE rig = ?1 AND version = ?2",
                 rig_id,
                 version);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return absl::NotFoundError(
        fmt::format("rig {} has no calibration {}", rig, version));
  }
  return CalibrationFromRow(db, read, rig_id, rig);
}

absl::StatusOr<StoredCalibration> ReadActiveCalibration(
    Connection* db, const std::string& rig) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t version,
                           ActiveVersion(db, rig_id));
  return ReadCalibration(db, rig, version);
}

absl::StatusOr<Listed<StoredCalibration>> ListCalibrationRows(
    Connection* db, const std::string& rig, const Page& page) {
  const std::string list = "calibrations/" + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto before, PageNumber(list, page));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  const int size = PageSize(page);
  Statement read(db,
                 std::string(kColumns) +
                     "WHERE rig = ?1 AND version < ?2 "
                     "ORDER BY version DESC LIMIT ?3",
                 rig_id,
                 before.value_or(INT64_MAX),
                 size + 1);
  Listed<StoredCalibration> listed;
  while (read.Next()) {
    SELFCAL_ASSIGN_OR_RETURN(StoredCalibration calibration,
                             CalibrationFromRow(db, read, rig_id, rig));
    listed.items.push_back(std::move(calibration));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  CutPage(
      list, size, [](const auto& item) { return item.version; }, &listed);
  return listed;
}

absl::StatusOr<std::int64_t> ActiveVersion(Connection* db, std::int64_t rig) {
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

absl::StatusOr<std::int64_t> NextVersion(Connection* db, std::int64_t rig) {
  Statement read(db,
                 "SELECT coalesce(max(version), 0) + 1 FROM calibrations "
                 "WHERE rig = ?1",
                 rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  return found ? read.Int(0) : 1;
}

absl::Status InsertCalibration(Connection* db,
                               std::int64_t rig,
                               const StoredCalibration& calibration) {
  if (calibration.state == CalibrationState::kActive) {
    SELFCAL_RETURN_IF_ERROR(Statement(db,
                                      "UPDATE calibrations SET state = 2 "
                                      "WHERE rig = ?1 AND state = 1",
                                      rig)
                                .Run());
  }
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
  return AppendCalibrationEvent(db, calibration);
}

}  // namespace selfcal::server
