#include "server/store/segment_rows.h"

#include <fmt/format.h>

#include <cstdint>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/exclusions.h"
#include "server/store/outbox.h"
#include "server/store/own_rig.h"
#include "server/store/rigs.h"
#include "server/store/segment_path.h"
#include "server/store/unscored_rigs.h"

namespace selfcal::server {
namespace {

constexpr char kColumns[] =
    "s.session, s.session_index, s.sequence, s.state, s.steady_ns, s.fit, "
    "s.temperature_c";
constexpr int kNextColumn = 7;  // after these

SegmentRow RowOf(const Statement& row) {
  SegmentRow segment{.key = {row.Text(0), row.Int(1)},
                     .sequence = row.Int(2),
                     .state = static_cast<SegmentState>(row.Int(3)),
                     .receive_steady_ns = row.Int(4),
                     .fit = row.Double(5)};
  if (!row.IsNull(6)) segment.temperature_c = row.Double(6);
  return segment;
}

absl::StatusOr<std::vector<SegmentRow>> ReadRows(Statement* read) {
  std::vector<SegmentRow> rows;
  while (read->Next()) rows.push_back(RowOf(*read));
  SELFCAL_RETURN_IF_ERROR(read->status());
  return rows;
}

}  // namespace

std::string SegmentText(const std::string& rig, const SegmentKey& key) {
  return fmt::format("segment {}~{} of rig {}", key.session, key.index, rig);
}

absl::Status OfAnotherSegment(const std::string& what,
                              const std::string& other_rig,
                              const SegmentKey& other) {
  return absl::DataLossError(fmt::format(
      "{} is damaged: it is that of {}; check the disk, and restore "
      "the database from a backup if it is needed",
      what,
      SegmentText(other_rig, other)));
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
  packed.motion = MotionStatisticsOf(segment);
  packed.path = PathOf(segment);
  SELFCAL_ASSIGN_OR_RETURN(packed.payload, PackSegment(segment));
  return packed;
}

absl::StatusOr<SegmentRow> FindSegment(UnitOfWork* tx, const SegmentKey& key) {
  Statement read(tx->db(),
                 fmt::format("SELECT {} FROM segments s WHERE s.rig = ?1 "
                             "AND s.session = ?2 AND s.session_index = ?3",
                             kColumns),
                 tx->rig_row(),
                 key.session,
                 key.index);
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentRow> rows, ReadRows(&read));
  if (rows.empty()) {
    return absl::NotFoundError(SegmentText(tx->rig(), key) +
                               " was never received");
  }
  return rows.front();
}

absl::StatusOr<StoredSegment> ReadSegment(UnitOfWork* tx,
                                          const SegmentKey& key) {
  return ReadSegment(tx->db(), tx->rig(), key);
}

absl::StatusOr<std::vector<SegmentRow>> SegmentsOfSession(
    UnitOfWork* tx,
    const std::string& session,
    std::optional<std::int64_t> index) {
  Statement read(tx->db(),
                 fmt::format("SELECT {} FROM segments s WHERE s.rig = ?1 "
                             "AND s.session = ?2 "
                             "AND (CAST(?3 AS BIGINT) IS NULL "
                             "  OR s.session_index = ?3) "
                             "ORDER BY s.sequence",
                             kColumns),
                 tx->rig_row(),
                 session,
                 index);
  return ReadRows(&read);
}

absl::StatusOr<std::vector<SegmentRow>> SegmentsInTables(UnitOfWork* tx) {
  Statement read(tx->db(),
                 fmt::format("SELECT {} FROM (SELECT DISTINCT sequence "
                             "  FROM table_entries WHERE rig = ?1) e "
                             "CROSS JOIN segments s "
                             "WHERE s.rig = ?1 AND s.sequence = e.sequence "
                             "ORDER BY s.sequence",
                             kColumns),
                 tx->rig_row());
  return ReadRows(&read);
}

absl::StatusOr<std::int64_t> CountUnscored(UnitOfWork* tx) {
  return ReadInt(tx->db(),
                 "SELECT count(*) FROM segments WHERE rig = ?1 AND state = 1",
                 tx->rig_row());
}

absl::StatusOr<bool> HasUnscored(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t found,
                           ReadInt(tx->db(),
                                   "SELECT EXISTS (SELECT 1 FROM segments "
                                   "  WHERE rig = ?1 AND state = 1)",
                                   tx->rig_row()));
  return found != 0;
}

absl::StatusOr<std::int64_t> CountScored(UnitOfWork* tx,
                                         std::int64_t first_sequence) {
  return ReadInt(tx->db(),
                 "SELECT count(*) FROM segments "
                 "WHERE rig = ?1 AND state = 2 AND sequence >= ?2",
                 tx->rig_row(),
                 first_sequence);
}

absl::StatusOr<std::int64_t> NewestSequence(UnitOfWork* tx) {
  return ReadInt(tx->db(),
                 "SELECT max(sequence) FROM segments WHERE rig = ?1",
                 tx->rig_row());
}

absl::StatusOr<std::int64_t> NewestArrival(UnitOfWork* tx) {
  return ReadInt(tx->db(),
                 "SELECT coalesce((SELECT steady_ns FROM segments "
                 "  WHERE rig = ?1 ORDER BY sequence DESC LIMIT 1), 0)",
                 tx->rig_row());
}

absl::StatusOr<std::vector<double>> NewestFits(UnitOfWork* tx, int limit) {
  Statement read(tx->db(),
                 "SELECT fit FROM segments WHERE rig = ?1 AND state = 2 "
                 "ORDER BY sequence DESC LIMIT ?2",
                 tx->rig_row(),
                 limit);
  std::vector<double> fits;
  while (read.Next()) fits.push_back(read.Double(0));
  SELFCAL_RETURN_IF_ERROR(read.status());
  return fits;
}

absl::StatusOr<std::vector<SegmentRow>> UnreferencedSegments(UnitOfWork* tx,
                                                             int limit) {
  Statement read(
      tx->db(),
      fmt::format("SELECT {} FROM segments s "
                  "WHERE s.rig = ?1 AND s.state <> 1 "
                  "AND NOT EXISTS (SELECT 1 FROM table_entries e "
                  "  WHERE e.rig = s.rig AND e.sequence = s.sequence) "
                  "AND NOT EXISTS (SELECT 1 FROM run_segments x "
                  "  WHERE x.rig = s.rig AND x.sequence = s.sequence) "
                  "AND NOT EXISTS (SELECT 1 FROM calibration_segments c "
                  "  WHERE c.rig = s.rig AND c.sequence = s.sequence) "
                  "ORDER BY s.sequence LIMIT ?2",
                  kColumns),
      tx->rig_row(),
      limit);
  return ReadRows(&read);
}

absl::StatusOr<std::int64_t> InsertSegment(UnitOfWork* tx,
                                           const NewSegment& segment) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t sequence,
      InsertReturning(
          tx->db(),
          "INSERT INTO segments (rig, session, session_index, sequence, "
          "  state, receive_time_ns, calibration_version, start_ns, end_ns, "
          "  keyframes, imu_samples, landmarks, observations, "
          "  temperature_c, angular_rate, acceleration, steady_ns) "
          "VALUES (?1, ?2, ?3, (SELECT coalesce(max(sequence), 0) + 1 "
          "    FROM segments WHERE rig = ?1), "
          "  1, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, "
          "  ?15) "
          "RETURNING sequence",
          tx->rig_row(),
          segment.key.session,
          segment.key.index,
          tx->time_ns(),
          segment.calibration_version,
          segment.start_ns,
          segment.end_ns,
          segment.keyframes,
          segment.imu_samples,
          segment.landmarks,
          segment.observations,
          segment.temperature_c,
          segment.motion.angular_rate_radps,
          segment.motion.acceleration_mps2,
          tx->now().steady_ns));
  SELFCAL_RETURN_IF_ERROR(Statement(tx->db(),
                                    "UPDATE rigs SET last_seen_ns = ?2 "
                                    "WHERE rig = ?1 AND last_seen_ns < ?2",
                                    tx->rig_row(),
                                    tx->time_ns())
                              .Run());
  tx->Changed(RecordKind::kSegment, sequence);
  SELFCAL_RETURN_IF_ERROR(InsertPath(tx, sequence, segment.path));
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "INSERT INTO payloads (rig, sequence, data, raw_bytes, "
                "  sha256) VALUES (?1, ?2, ?3, ?4, ?5)",
                tx->rig_row(),
                sequence,
                BlobView{segment.payload.data},
                segment.payload.raw_bytes,
                BlobView{segment.payload.sha256})
          .Run());
  return sequence;
}

absl::StatusOr<Payload> ReadPayload(Connection* db,
                                    const std::string& rig,
                                    const SegmentKey& key) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  UnitOfWork tx(db, rig, rig_id, 0);
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow row, FindSegment(&tx, key));
  Statement read(db,
                 "SELECT data, raw_bytes, sha256 FROM payloads "
                 "WHERE rig = ?1 AND sequence = ?2",
                 rig_id,
                 row.sequence);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    Statement why(db,
                  "SELECT problem FROM segments "
                  "WHERE rig = ?1 AND sequence = ?2",
                  rig_id,
                  row.sequence);
    const std::string problem = why.Next() ? why.Text(0) : "";
    SELFCAL_RETURN_IF_ERROR(why.status());
    return absl::FailedPreconditionError(fmt::format(
        "the data of {} was dropped: {}",
        SegmentText(rig, key),
        problem.empty() ? "no table and no run needs it" : problem));
  }
  return Payload{read.Text(0), read.Int(1), read.Text(2)};
}

absl::StatusOr<std::vector<Store::Unscored>> ListUnscoredRows(
    Connection* db, int of_each_rig, const std::string& replica) {
  // Each step is a search for one row, whatever statistics the engine has: a
  // join could read all that wait.
  const auto column = [](const std::string& expression) {
    return "(SELECT " + expression +
           " FROM segments s "
           "  WHERE s.rig = o.rig AND s.sequence = o.sequence), ";
  };
  Statement read(
      db,
      WithUnscoredRigs() +
          ", oldest (rig, sequence, place) AS ("
          "  SELECT u.rig, (SELECT s.sequence FROM segments s "
          "    WHERE s.state = 1 AND s.rig = u.rig "
          "    ORDER BY s.sequence LIMIT 1), 1 "
          "  FROM unscored_rigs u WHERE u.rig IS NOT NULL "
          "    AND (?2 = '' OR EXISTS (SELECT 1 FROM claims c "
          "      WHERE c.rig = u.rig AND c.replica = ?2)) AND " +
          IsOwnRig("u.rig") +
          "  UNION ALL "
          "  SELECT o.rig, (SELECT s.sequence FROM segments s "
          "    WHERE s.state = 1 AND s.rig = o.rig "
          "      AND s.sequence > o.sequence "
          "    ORDER BY s.sequence LIMIT 1), o.place + 1 "
          "  FROM oldest o WHERE o.sequence IS NOT NULL AND o.place < ?1) "
          "SELECT (SELECT r.id FROM rigs r WHERE r.rig = o.rig), " +
          column("s.session") + column("s.session_index") +
          column("s.observations + s.imu_samples") +
          "o.sequence FROM oldest o WHERE o.sequence IS NOT NULL "
          "ORDER BY o.rig, o.sequence",
      of_each_rig,
      replica);
  std::vector<Store::Unscored> unscored;
  while (read.Next()) {
    unscored.push_back(
        {read.Text(0), {read.Text(1), read.Int(2)}, read.Int(4), read.Int(3)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return unscored;
}

absl::StatusOr<std::int64_t> CountUnscoredRows(Connection* db,
                                               const std::string& rig) {
  return ReadInt(db,
                 "SELECT COUNT(*) FROM segments WHERE state = 1 "
                 "AND rig = (SELECT rig FROM rigs WHERE id = ?1)",
                 rig);
}

absl::Status WriteUnusable(UnitOfWork* tx,
                           std::int64_t sequence,
                           const std::string& problem) {
  tx->Changed(RecordKind::kSegment, sequence);
  return Statement(tx->db(),
                   "UPDATE segments SET state = 3, problem = ?3 "
                   "WHERE rig = ?1 AND sequence = ?2",
                   tx->rig_row(),
                   sequence,
                   problem)
      .Run();
}

absl::Status WriteProblem(UnitOfWork* tx,
                          std::int64_t sequence,
                          const std::string& problem) {
  tx->Changed(RecordKind::kSegment, sequence);
  return Statement(tx->db(),
                   "UPDATE segments SET problem = ?3 "
                   "WHERE rig = ?1 AND sequence = ?2",
                   tx->rig_row(),
                   sequence,
                   problem)
      .Run();
}

absl::StatusOr<SegmentUsers> UsersOf(UnitOfWork* tx, std::int64_t sequence) {
  SegmentUsers users;
  Statement version(tx->db(),
                    "SELECT max(version) FROM calibration_segments "
                    "WHERE rig = ?1 AND sequence = ?2",
                    tx->rig_row(),
                    sequence);
  if (version.Next() && !version.IsNull(0)) users.version = version.Int(0);
  SELFCAL_RETURN_IF_ERROR(version.status());
  Statement run(tx->db(),
                "SELECT max(r.run) FROM run_segments x JOIN runs r "
                "  ON r.rig = x.rig AND r.run = x.run "
                "WHERE x.rig = ?1 AND x.sequence = ?2 AND r.state IN (1, 2)",
                tx->rig_row(),
                sequence);
  if (run.Next() && !run.IsNull(0)) users.unfinished_run = run.Int(0);
  SELFCAL_RETURN_IF_ERROR(run.status());
  return users;
}

absl::Status DeleteSegment(UnitOfWork* tx, std::int64_t sequence) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestSequence(tx));
  if (sequence == newest) {
    // The next segments to arrive take its number, and those of the segments
    // that were deleted just before it in the order of arrival.
    Statement forget(tx->db(),
                     "UPDATE table_absences SET rival = NULL "
                     "WHERE rig = ?1 AND rival > (SELECT "
                     "  coalesce(max(sequence), 0) FROM segments "
                     "  WHERE rig = ?1 AND sequence < ?2) RETURNING sequence",
                     tx->rig_row(),
                     sequence);
    while (forget.Next()) tx->Changed(RecordKind::kSegment, forget.Int(0));
    SELFCAL_RETURN_IF_ERROR(forget.status());
  }
  return DeleteSegmentAlone(tx, sequence);
}

absl::Status DeleteSegmentAlone(UnitOfWork* tx, std::int64_t sequence) {
  tx->Changed(RecordKind::kSegment, sequence);
  Statement runs(tx->db(),
                 "SELECT run FROM run_segments "
                 "WHERE rig = ?1 AND sequence = ?2",
                 tx->rig_row(),
                 sequence);
  while (runs.Next()) tx->Changed(RecordKind::kRun, runs.Int(0));
  SELFCAL_RETURN_IF_ERROR(runs.status());
  for (const char* table : {"table_entries",
                            "run_segments",
                            "payloads",
                            "table_absences",
                            "segment_scores",
                            "segment_information",
                            "segment_ends",
                            "segment_paths",
                            "segments"}) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(tx->db(),
                  fmt::format("DELETE FROM {} WHERE rig = ?1 AND sequence = ?2",
                              table),
                  tx->rig_row(),
                  sequence)
            .Run());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<DataHolder>> DataHolders(
    UnitOfWork* tx, ExclusionCauses excluded_for) {
  Statement read(
      tx->db(),
      fmt::format("SELECT {}, length(p.data), "
                  "  EXISTS (SELECT 1 FROM run_segments x JOIN runs r "
                  "    ON r.rig = x.rig AND r.run = x.run "
                  "    WHERE x.rig = p.rig AND x.sequence = p.sequence "
                  "      AND r.state IN (1, 2)), "
                  "  (SELECT max(e.gain) FROM table_entries e "
                  "    WHERE e.rig = p.rig AND e.sequence = p.sequence), "
                  "  {}, "
                  "  EXISTS (SELECT 1 FROM outbox o JOIN uplinks u USING (rig) "
                  "    WHERE o.rig = p.rig AND o.kind = {} "
                  "      AND o.number = p.sequence AND u.data = {}) "
                  "FROM payloads p CROSS JOIN segments s "
                  "WHERE s.rig = p.rig AND s.sequence = p.sequence "
                  "AND p.rig = ?1 AND s.state <> 1 ORDER BY p.sequence",
                  kColumns,
                  ExcludedFor("?2"),
                  static_cast<int>(RecordKind::kData),
                  static_cast<int>(ReportedData::kAll)),
      tx->rig_row(),
      excluded_for.bits());
  std::vector<DataHolder> holders;
  while (read.Next()) {
    DataHolder& holder = holders.emplace_back();
    holder.segment = RowOf(read);
    holder.bytes = read.Int(kNextColumn);
    holder.in_unfinished_run = read.Int(kNextColumn + 1) != 0;
    if (!read.IsNull(kNextColumn + 2)) {
      holder.gain = read.Double(kNextColumn + 2);
    }
    holder.excluded = read.Int(kNextColumn + 3) != 0;
    holder.to_report = read.Int(kNextColumn + 4) != 0;
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return holders;
}

absl::StatusOr<std::int64_t> DataBytes(UnitOfWork* tx) {
  return ReadInt(tx->db(),
                 "SELECT coalesce(sum(length(data)), 0) FROM payloads "
                 "WHERE rig = ?1",
                 tx->rig_row());
}

absl::StatusOr<bool> HasData(UnitOfWork* tx, std::int64_t sequence) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t count,
      ReadInt(tx->db(),
              "SELECT count(*) FROM payloads WHERE rig = ?1 AND sequence = ?2",
              tx->rig_row(),
              sequence));
  return count > 0;
}

absl::Status DeleteData(UnitOfWork* tx, std::int64_t sequence) {
  return Statement(tx->db(),
                   "DELETE FROM payloads WHERE rig = ?1 AND sequence = ?2",
                   tx->rig_row(),
                   sequence)
      .Run();
}

}  // namespace selfcal::server
