#include "server/store/segment_rows.h"

#include <fmt/format.h>

#include "server/store/clock.h"
#include "server/store/fit_rows.h"
#include "server/store/quotas.h"
#include "server/store/rigs.h"
#include "server/store/segment_path.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

absl::Status InsertMetadata(Connection* db,
                            std::int64_t rig,
                            const NewSegment& segment) {
  return Statement(
             db,
             "INSERT INTO segments (rig, session, session_index, sequence, "
             "  state, receive_time_ns, calibration_version, start_ns, end_ns, "
             "  keyframes, imu_samples, landmarks, observations, "
             "  temperature_c) "
             "VALUES (?1, ?2, ?3, (SELECT coalesce(max(sequence), 0) + 1 "
             "    FROM segments WHERE rig = ?1), "
             "  1, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)",
             rig,
             segment.key.session,
             segment.key.index,
             NowNs(),
             segment.calibration_version,
             segment.start_ns,
             segment.end_ns,
             segment.keyframes,
             segment.imu_samples,
             segment.landmarks,
             segment.observations,
             segment.temperature_c)
      .Run();
}

}  // namespace

std::string SegmentText(const std::string& rig, const SegmentKey& key) {
  return fmt::format("segment {}~{} of rig {}", key.session, key.index, rig);
}

absl::StatusOr<NewSegment> PackNewSegment(const MotionSegment& segment) {
  NewSegment packed;
  packed.key = segment.key;
  packed.calibration_version = segment.calibration_version;
  if (!segment.keyframes.empty()) {
    packed.start_ns = segment.keyframes.front().t_ns;
    packed.end_ns = segment.keyframes.back().t_ns;
  }
  packed.keyframes = static_cast<std::int64_t>(segment.keyframes.size());
  packed.imu_samples = static_cast<std::int64_t>(segment.imu.size());
  packed.landmarks = static_cast<std::int64_t>(segment.landmarks.size());
  packed.observations = static_cast<std::int64_t>(segment.observations.size());
  packed.temperature_c = segment.temperature_c;
  packed.path = PathOf(segment);
  SELFCAL_ASSIGN_OR_RETURN(packed.payload, PackSegment(segment));
  return packed;
}

absl::StatusOr<PutVerdict> PutSegmentRow(Connection* db,
                                         const std::string& rig,
                                         const NewSegment& segment,
                                         const Quotas& quotas) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  const auto existing = FindSegment(db, rig_id, segment.key);
  if (existing.ok()) {
    return PutVerdict::kDuplicate;
  }
  if (!absl::IsNotFound(existing.status())) {
    return existing.status();
  }
  SELFCAL_RETURN_IF_ERROR(
      MakeRoom(db,
               rig_id,
               rig,
               static_cast<std::int64_t>(segment.payload.data.size()),
               quotas));
  SELFCAL_RETURN_IF_ERROR(DropOldSegments(db, rig_id, rig, quotas));
  SELFCAL_RETURN_IF_ERROR(InsertMetadata(db, rig_id, segment));
  const std::int64_t row = sqlite3_last_insert_rowid(db->handle());
  SELFCAL_RETURN_IF_ERROR(InsertPath(db, row, segment.path));
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                "INSERT INTO payloads (segment, rig, data, raw_bytes, sha256) "
                "VALUES (?1, ?2, ?3, ?4, ?5)",
                row,
                rig_id,
                BlobView{segment.payload.data},
                segment.payload.raw_bytes,
                BlobView{segment.payload.sha256})
          .Run());
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return PutVerdict::kStored;
}

absl::StatusOr<SegmentRow> FindSegment(Connection* db,
                                       std::int64_t rig,
                                       const SegmentKey& key) {
  Statement read(db,
                 "SELECT segment, sequence, state FROM segments "
                 "WHERE rig = ?1 AND session = ?2 AND session_index = ?3",
                 rig,
                 key.session,
                 key.index);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return absl::NotFoundError(fmt::format(
        "segment {}~{} was never received", key.session, key.index));
  }
  return SegmentRow{
      read.Int(0), read.Int(1), static_cast<SegmentState>(read.Int(2) - 1)};
}

absl::StatusOr<Payload> ReadPayload(Connection* db,
                                    const std::string& rig,
                                    const SegmentKey& key) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow row, FindSegment(db, rig_id, key));
  Statement read(
      db,
      "SELECT data, raw_bytes, sha256 FROM payloads WHERE segment = ?1",
      row.rowid);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    Statement why(
        db, "SELECT problem FROM segments WHERE segment = ?1", row.rowid);
    const std::string problem = why.Next() ? why.Text(0) : "";
    SELFCAL_RETURN_IF_ERROR(why.status());
    return absl::FailedPreconditionError(fmt::format(
        "the data of {} was dropped: {}",
        SegmentText(rig, key),
        problem.empty() ? "no table and no run needs it" : problem));
  }
  return Payload{read.Text(0), read.Int(1), read.Text(2)};
}

absl::StatusOr<std::vector<Store::Unscored>> ListUnscoredRows(Connection* db,
                                                              int limit) {
  Statement read(db,
                 "SELECT r.id, s.session, s.session_index, s.sequence "
                 "FROM segments s JOIN rigs r USING (rig) "
                 "WHERE s.state = 1 ORDER BY s.segment LIMIT ?1",
                 limit);
  std::vector<Store::Unscored> unscored;
  while (read.Next()) {
    unscored.push_back(
        {read.Text(0), {read.Text(1), read.Int(2)}, read.Int(3)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return unscored;
}

absl::Status WriteProblem(Connection* db,
                          std::int64_t segment,
                          const std::string& problem) {
  return Statement(db,
                   "UPDATE segments SET state = 3, problem = ?2 "
                   "WHERE segment = ?1",
                   segment,
                   problem)
      .Run();
}

absl::Status DropUnreferencedPayloads(Connection* db, std::int64_t rig) {
  return Statement(
             db,
             fmt::format(
                 "DELETE FROM payloads WHERE rig = ?1 "
                 "AND NOT EXISTS (SELECT 1 FROM segments s "
                 "  WHERE s.segment = payloads.segment AND s.state = 1) "
                 "AND NOT EXISTS (SELECT 1 FROM table_entries e "
                 "  WHERE e.segment = payloads.segment) "
                 "AND NOT EXISTS (SELECT 1 FROM run_segments x "
                 "  JOIN runs r ON r.rig = x.rig AND r.run = x.run "
                 "  WHERE x.segment = payloads.segment AND r.state IN (1, 2)) "
                 "AND segment NOT IN (SELECT s.segment "
                 "  FROM payloads p JOIN segments s USING (segment) "
                 "  WHERE p.rig = ?1 AND s.state = 2 "
                 "  AND s.sequence >= (SELECT coalesce(max(c.first_sequence), "
                 "0) "
                 "    FROM changes c WHERE c.rig = ?1) "
                 "  AND {} "
                 "  AND NOT EXISTS (SELECT 1 FROM table_entries e "
                 "    WHERE e.segment = s.segment) "
                 "  ORDER BY s.sequence DESC LIMIT ?2)",
                 kFits),
             rig,
             Store::kReserve)
      .Run();
}

}  // namespace selfcal::server
