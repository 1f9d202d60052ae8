// Reads StoredSegments, one or a page of them, and writes the information that
// is read here.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <utility>
#include <vector>

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
    "s.rig, s.sequence, (SELECT g.id FROM rigs g WHERE g.rig = s.rig), "
    "  s.session, s.session_index, s.state, s.problem, s.receive_time_ns, "
    "  s.calibration_version, s.start_ns, s.end_ns, s.keyframes, "
    "  s.imu_samples, s.landmarks, s.observations, "
    "  (SELECT length(p.data) FROM payloads p "
    "    WHERE p.rig = s.rig AND p.sequence = s.sequence), "
    "  s.temperature_c, s.angular_rate, s.acceleration";
constexpr int kInformationColumn = 19;  // after these, and its checksum

StoredSegment MetadataFromRow(const Statement& row) {
  StoredSegment segment;
  segment.sequence = row.Int(1);
  segment.rig = row.Text(2);
  segment.key = {row.Text(3), row.Int(4)};
  segment.state = static_cast<SegmentState>(row.Int(5));
  segment.problem = row.Text(6);
  segment.receive_time_ns = row.Int(7);
  segment.calibration_version = row.Int(8);
  segment.start_ns = row.Int(9);
  segment.end_ns = row.Int(10);
  segment.keyframes = static_cast<int>(row.Int(11));
  segment.imu_samples = static_cast<int>(row.Int(12));
  segment.landmarks = static_cast<int>(row.Int(13));
  segment.observations = static_cast<int>(row.Int(14));
  segment.has_data = !row.IsNull(15);
  segment.payload_bytes = row.Int(15);
  if (!row.IsNull(16)) segment.temperature_c = row.Double(16);
  if (!row.IsNull(17) && !row.IsNull(18)) {
    segment.motion = {.angular_rate_radps = row.Double(17),
                      .acceleration_mps2 = row.Double(18)};
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

// The rows of a page in the table with this name.
SqlCondition AreOnPage(const std::string& table,
                       const std::vector<SegmentPlace>& page) {
  SqlCondition condition;
  const std::int64_t rig = page.front().rig;
  const bool of_one_rig = std::all_of(
      page.begin(), page.end(), [&](const auto& at) { return at.rig == rig; });
  std::vector<std::int64_t> sequences;
  std::vector<std::vector<SqlCondition::Value>> rows;
  for (const SegmentPlace& at : page) {
    sequences.push_back(at.sequence);
    rows.push_back({at.rig, at.sequence});
  }
  if (of_one_rig) {
    condition.And(fmt::format("{0}.rig = {1} AND {0}.sequence IN ({2})",
                              table,
                              condition.Parameter(rig),
                              fmt::join(sequences, ", ")));
  } else {
    condition.AndIn(fmt::format("({0}.rig, {0}.sequence)", table), rows);
  }
  return condition;
}

// The segments of a page, by the keys of their rig and their sequence.
using PageRows = std::map<std::pair<std::int64_t, std::int64_t>, StoredSegment>;

// Calls `take` with each row that `select` finds for the page, and with its
// keys, which are the first two columns.
absl::Status ReadOnPage(
    Connection* db,
    const std::string& select,
    const std::string& table,
    const std::vector<SegmentPlace>& page,
    const std::function<absl::Status(const PageRows::key_type&,
                                     const Statement&)>& take) {
  const SqlCondition condition = AreOnPage(table, page);
  Statement read(db, Reuse::kOnce, select + " WHERE " + condition.sql());
  condition.Bind(&read);
  while (read.Next()) {
    SELFCAL_RETURN_IF_ERROR(take({read.Int(0), read.Int(1)}, read));
  }
  return read.status();
}

absl::Status TakeInformation(const Statement& row, StoredSegment* segment) {
  auto information =
      InformationFromRow(segment->rig, segment->key, row.Text(2), row.Text(3));
  const absl::Status& status = information.status();
  if (absl::IsDataLoss(status)) {
    segment->problem = std::string(status.message());
    return absl::OkStatus();
  }
  SELFCAL_RETURN_IF_ERROR(status);
  segment->information = *std::move(information);
  return absl::OkStatus();
}

absl::StatusOr<PageRows> ReadPageRows(Connection* db,
                                      const std::vector<SegmentPlace>& page) {
  PageRows rows;
  if (page.empty()) return rows;
  SELFCAL_RETURN_IF_ERROR(
      ReadOnPage(db,
                 fmt::format("SELECT {} FROM segments s", kSegmentColumns),
                 "s",
                 page,
                 [&](const auto& key, const Statement& row) {
                   rows.emplace(key, MetadataFromRow(row));
                   return absl::OkStatus();
                 }));
  SELFCAL_RETURN_IF_ERROR(
      ReadOnPage(db,
                 "SELECT i.rig, i.sequence, i.information, i.sha256 "
                 "FROM segment_information i",
                 "i",
                 page,
                 [&](const auto& key, const Statement& row) {
                   const auto segment = rows.find(key);
                   if (segment == rows.end()) return absl::OkStatus();
                   return TakeInformation(row, &segment->second);
                 }));
  SELFCAL_RETURN_IF_ERROR(
      ReadOnPage(db,
                 "SELECT e.rig, e.sequence, e.group_name FROM table_entries e",
                 "e",
                 page,
                 [&](const auto& key, const Statement& row) {
                   const auto segment = rows.find(key);
                   if (segment == rows.end()) return absl::OkStatus();
                   segment->second.tables.push_back(row.Text(2));
                   return absl::OkStatus();
                 }));
  return rows;
}

}  // namespace

absl::StatusOr<StoredSegment> ReadSegment(Connection* db,
                                          const std::string& rig,
                                          const SegmentKey& key) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(db,
                 fmt::format("SELECT {}, i.information, i.sha256 "
                             "FROM segments s LEFT JOIN "
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
  StoredSegment segment = MetadataFromRow(read);
  SELFCAL_ASSIGN_OR_RETURN(segment.tables,
                           TablesOfSegment(db, rig_id, segment.sequence));
  if (!read.IsNull(kInformationColumn)) {
    SELFCAL_ASSIGN_OR_RETURN(
        segment.information,
        InformationFromRow(segment.rig,
                           segment.key,
                           read.Text(kInformationColumn),
                           read.Text(kInformationColumn + 1)));
  }
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
  const std::string sql = SelectPlaces(
      rig_id, query, of, after, static_cast<int>(size) + 1, &condition);
  Statement read(db, Reuse::kOnce, sql);
  condition.Bind(&read);
  std::vector<SegmentPlace> places;
  Listed<StoredSegment> listed;
  while (read.Next()) {
    if (places.size() == size) {
      listed.next_token = TokenAfter(list, places.back());
      break;
    }
    places.push_back(PlaceOfRow(rig_id, query, read));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  SELFCAL_ASSIGN_OR_RETURN(PageRows rows, ReadPageRows(db, places));
  for (const SegmentPlace& place : places) {
    // A damaged index names rows that do not exist.
    const auto row = rows.find({place.rig, place.sequence});
    if (row != rows.end()) listed.items.push_back(std::move(row->second));
  }
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
