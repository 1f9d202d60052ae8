// Reads StoredSegments, one or a page of them, and writes the information that
// is read here.
#include <fmt/format.h>

#include <cmath>
#include <cstdint>

#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/exclusions.h"
#include "server/store/paging.h"
#include "server/store/records.h"
#include "server/store/rigs.h"
#include "server/store/segment_query_sql.h"
#include "server/store/segment_rows.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

constexpr char kSegmentColumns[] =
    "s.session, s.session_index, s.sequence, s.state, s.problem, "
    "  s.receive_time_ns, s.calibration_version, s.start_ns, s.end_ns, "
    "  s.keyframes, s.imu_samples, s.landmarks, s.observations, "
    "  i.information, i.sha256, "
    "  (SELECT length(p.data) FROM payloads p "
    "    WHERE p.rig = s.rig AND p.sequence = s.sequence), "
    "  s.temperature_c, s.steady_ns, s.rig, "
    "  (SELECT g.id FROM rigs g WHERE g.rig = s.rig), "
    "  s.angular_rate, s.acceleration";
constexpr int kSteadyColumn = 17;
constexpr int kRigColumn = 18;
constexpr int kKeyColumn = 22;  // after the columns of a list

StoredSegment MetadataFromRow(const Statement& row) {
  StoredSegment segment;
  segment.rig = row.Text(19);
  segment.key = {row.Text(0), row.Int(1)};
  segment.sequence = row.Int(2);
  segment.state = static_cast<SegmentState>(row.Int(3));
  segment.problem = row.Text(4);
  segment.receive_time_ns = row.Int(5);
  segment.calibration_version = row.Int(6);
  segment.start_ns = row.Int(7);
  segment.end_ns = row.Int(8);
  segment.keyframes = static_cast<int>(row.Int(9));
  segment.imu_samples = static_cast<int>(row.Int(10));
  segment.landmarks = static_cast<int>(row.Int(11));
  segment.observations = static_cast<int>(row.Int(12));
  segment.has_data = !row.IsNull(15);
  segment.payload_bytes = row.Int(15);
  if (!row.IsNull(16)) segment.temperature_c = row.Double(16);
  if (!row.IsNull(20) && !row.IsNull(21)) {
    segment.motion = {.angular_rate_radps = row.Double(20),
                      .acceleration_mps2 = row.Double(21)};
  }
  return segment;
}

absl::StatusOr<SegmentInformation> InformationFromRow(
    const std::string& rig,
    const SegmentKey& key,
    const std::string& bytes,
    const std::string& sha256) {
  SELFCAL_RETURN_IF_ERROR(VerifySha256(
      bytes, sha256, "the information of " + SegmentText(rig, key)));
  return ParseInformationOf(rig, key, bytes);
}

// Fills what it can; the status is that of the information.
absl::Status FillFromRow(Connection* db,
                         const Statement& row,
                         StoredSegment* segment) {
  *segment = MetadataFromRow(row);
  SELFCAL_ASSIGN_OR_RETURN(
      segment->tables,
      TablesOfSegment(db, row.Int(kRigColumn), segment->sequence));
  if (row.IsNull(13)) {
    return absl::OkStatus();
  }
  SELFCAL_ASSIGN_OR_RETURN(
      segment->information,
      InformationFromRow(
          segment->rig, segment->key, row.Text(13), row.Text(14)));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<StoredSegment> ReadSegment(Connection* db,
                                          const std::string& rig,
                                          const SegmentKey& key) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(db,
                 fmt::format("SELECT {} FROM segments s LEFT JOIN "
                             "segment_information i USING (rig, sequence) "
                             "WHERE s.rig = ?1 AND s.session = ?2 "
                             "AND s.session_index = ?3",
                             kSegmentColumns),
                 rig_id,
                 key.session,
                 key.index);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return absl::NotFoundError(SegmentText(rig, key) + " was never received");
  }
  StoredSegment segment;
  SELFCAL_RETURN_IF_ERROR(FillFromRow(db, read, &segment));
  if (segment.key != key) {
    return OfAnotherSegment(SegmentText(rig, key), segment.rig, segment.key);
  }
  return segment;
}

absl::StatusOr<Listed<StoredSegment>> ListSegmentRows(Connection* db,
                                                      const std::string& rig,
                                                      const SegmentQuery& query,
                                                      const Page& page,
                                                      const RigQuery& of) {
  if (rig.empty()) SELFCAL_RETURN_IF_ERROR(CheckOrderOfAll(query));
  const std::string list = ListName(rig, query, of);
  SELFCAL_ASSIGN_OR_RETURN(const auto after, PlaceOfPage(list, page));
  std::int64_t rig_id = 0;
  if (!rig.empty()) {
    SELFCAL_ASSIGN_OR_RETURN(rig_id, FindRigId(db, rig));
  }
  const auto size = static_cast<std::size_t>(PageSize(page));
  SqlCondition condition;
  const std::string sql = SelectSegments(kSegmentColumns,
                                         rig_id,
                                         query,
                                         of,
                                         after,
                                         static_cast<int>(size) + 1,
                                         &condition);
  Statement read(db, Reuse::kOnce, sql);
  condition.Bind(&read);
  Listed<StoredSegment> listed;
  SegmentPlace last;
  while (read.Next()) {
    if (listed.items.size() == size) {
      listed.next_token = TokenAfter(list, last);
      break;
    }
    StoredSegment segment;
    const absl::Status status = FillFromRow(db, read, &segment);
    if (absl::IsDataLoss(status)) {
      segment.problem = std::string(status.message());
    } else if (!status.ok()) {
      return status;
    }
    last = {read.Double(kKeyColumn),
            read.Int(kSteadyColumn),
            read.Int(kRigColumn),
            segment.sequence};
    listed.items.push_back(std::move(segment));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return listed;
}

absl::Status WriteScore(UnitOfWork* tx,
                        const SegmentRow& segment,
                        const SegmentInformation& information) {
  const std::int64_t sequence = segment.sequence;
  tx->Changed(RecordKind::kSegment, sequence);
  SELFCAL_RETURN_IF_ERROR(Statement(tx->db(),
                                    "UPDATE segments SET state = 2, fit = ?3 "
                                    "WHERE rig = ?1 AND sequence = ?2",
                                    tx->rig_row(),
                                    sequence,
                                    std::isnan(information.residuals.fit)
                                        ? 0.0
                                        : information.residuals.fit)
                              .Run());
  const std::string bytes =
      SerializeInformationOf(tx->rig(), segment.key, information);
  const std::string sha256 = Sha256(bytes);
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "INSERT INTO segment_information (rig, sequence, information, "
                "  sha256) VALUES (?1, ?2, ?3, ?4) "
                "ON CONFLICT (rig, sequence) DO UPDATE SET "
                "  information = excluded.information, "
                "  sha256 = excluded.sha256",
                tx->rig_row(),
                sequence,
                BlobView{bytes},
                BlobView{sha256})
          .Run());
  for (const GroupScore& score : information.groups) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(tx->db(),
                  "INSERT INTO segment_scores (rig, sequence, group_name, "
                  "  entropy, gain, rank) VALUES (?1, ?2, ?3, ?4, ?5, ?6) "
                  "ON CONFLICT (rig, sequence, group_name) DO UPDATE SET "
                  "  entropy = excluded.entropy, gain = excluded.gain, "
                  "  rank = excluded.rank",
                  tx->rig_row(),
                  sequence,
                  score.group,
                  score.entropy,
                  score.gain,
                  score.rank)
            .Run());
  }
  return absl::OkStatus();
}

absl::Status VisitScored(
    UnitOfWork* tx,
    const ScoredFilter& filter,
    const std::function<bool(const ScoredSegment&)>& visit) {
  Statement read(
      tx->db(),
      fmt::format("SELECT s.session, s.session_index, s.sequence, "
                  "  s.steady_ns, s.fit, i.information, i.sha256, "
                  "  EXISTS (SELECT 1 FROM payloads p WHERE p.rig = ?1 "
                  "    AND p.sequence = s.sequence) AS has_data "
                  "FROM segments s "
                  "JOIN segment_information i USING (rig, sequence) "
                  "WHERE s.rig = ?1 AND s.state = 2 AND s.sequence >= ?2 "
                  "  AND NOT {} "
                  "  AND NOT EXISTS (SELECT 1 FROM run_segments x "
                  "    WHERE x.rig = ?1 AND x.run = ?3 "
                  "      AND x.sequence = s.sequence) "
                  "  AND NOT EXISTS (SELECT 1 FROM calibration_segments c "
                  "    WHERE c.rig = ?1 AND c.version = ?4 "
                  "      AND c.sequence = s.sequence) "
                  "ORDER BY {} s.sequence DESC LIMIT ?5",
                  ExcludedFor("?6"),
                  filter.with_data_first ? "has_data DESC," : ""),
      tx->rig_row(),
      filter.first_sequence,
      filter.not_in_run,
      filter.not_in_version,
      filter.limit,
      filter.not_excluded_for.bits());
  while (read.Next()) {
    const SegmentKey key = {read.Text(0), read.Int(1)};
    const ScoredSegment scored{.segment = {.key = key,
                                           .sequence = read.Int(2),
                                           .state = SegmentState::kScored,
                                           .receive_steady_ns = read.Int(3),
                                           .fit = read.Double(4)},
                               .has_data = read.Int(7) != 0,
                               .information = InformationFromRow(
                                   tx->rig(), key, read.Text(5), read.Text(6))};
    if (!visit(scored)) break;
  }
  return read.status();
}

}  // namespace selfcal::server
