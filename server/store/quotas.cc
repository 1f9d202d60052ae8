#include "server/store/quotas.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "server/store/clock.h"
#include "server/store/events.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// Of the database, for scores, runs and calibrations of what is stored.
constexpr double kReserve = 0.1;
constexpr int kMaxDropped = 100;

absl::Status CheckDatabaseSize(Connection* db,
                               std::int64_t bytes,
                               const Quotas& quotas) {
  if (quotas.max_database_bytes == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t pages,
                           ReadInt(db, "PRAGMA page_count"));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t free,
                           ReadInt(db, "PRAGMA freelist_count"));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t size,
                           ReadInt(db, "PRAGMA page_size"));
  const std::int64_t used = (pages - free) * size;
  const auto open = static_cast<std::int64_t>(
      (1 - kReserve) * static_cast<double>(quotas.max_database_bytes));
  if (used + bytes <= open) return absl::OkStatus();
  return absl::ResourceExhaustedError(fmt::format(
      "the database holds {} of at most {} bytes, of which a tenth is kept for "
      "results: raise max-database-bytes, or set a quota by rig",
      used,
      quotas.max_database_bytes));
}

// The segment with data that is worth least: in no table, or of the smallest
// gain in those that hold it; older first.
constexpr char kLeastInformative[] =
    "SELECT p.segment, s.session, s.session_index, length(p.data) "
    "FROM payloads p JOIN segments s USING (segment) "
    "WHERE p.rig = ?1 AND s.state <> 1 "
    "AND NOT EXISTS (SELECT 1 FROM run_segments x "
    "  JOIN runs r ON r.rig = x.rig AND r.run = x.run "
    "  WHERE x.segment = p.segment AND r.state IN (1, 2)) "
    "ORDER BY (SELECT max(e.gain) FROM table_entries e "
    "  WHERE e.segment = p.segment), p.segment LIMIT 1";

// How many bytes became free; 0: nothing may go.
absl::StatusOr<std::int64_t> EvictOne(Connection* db,
                                      std::int64_t rig,
                                      const std::string& rig_name,
                                      const Quotas& quotas) {
  Statement read(db, kLeastInformative, rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) return 0;
  const std::int64_t segment = read.Int(0);
  const SegmentKey key{read.Text(1), read.Int(2)};
  const std::int64_t bytes = read.Int(3);
  const std::string why = fmt::format(
      "its data of {} bytes was evicted for newer segments: the data of a rig "
      "is limited to {} bytes",
      bytes,
      quotas.max_payload_bytes_per_rig);
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                "UPDATE segments SET problem = ?2 WHERE segment = ?1",
                segment,
                why)
          .Run());
  SELFCAL_RETURN_IF_ERROR(
      RemoveFromTables(db, segment, AbsenceCause::kDataEvicted));
  SELFCAL_RETURN_IF_ERROR(
      Statement(db, "DELETE FROM payloads WHERE segment = ?1", segment).Run());
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(db,
                  rig_name,
                  EventKind::kDataEvicted,
                  fmt::format("{}: {}", SegmentText(rig_name, key), why)));
  return std::max<std::int64_t>(bytes, 1);
}

}  // namespace

absl::Status LimitDatabase(Connection* db, const Quotas& quotas) {
  if (quotas.max_database_bytes == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t size,
                           ReadInt(db, "PRAGMA page_size"));
  return Statement(db,
                   fmt::format("PRAGMA max_page_count = {}",
                               std::max<std::int64_t>(
                                   1, quotas.max_database_bytes / size)))
      .Run();
}

absl::Status MakeRoom(Connection* db,
                      std::int64_t rig,
                      const std::string& rig_name,
                      std::int64_t bytes,
                      const Quotas& quotas) {
  SELFCAL_RETURN_IF_ERROR(CheckDatabaseSize(db, bytes, quotas));
  const std::int64_t limit = quotas.max_payload_bytes_per_rig;
  if (limit == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(
      std::int64_t used,
      ReadInt(db,
              "SELECT coalesce(sum(length(data)), 0) FROM payloads "
              "WHERE rig = ?1",
              rig));
  while (used + bytes > limit) {
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t freed,
                             EvictOne(db, rig, rig_name, quotas));
    if (freed == 0) {
      return absl::ResourceExhaustedError(fmt::format(
          "rig {} holds {} of at most {} bytes of data, all of it waiting for "
          "its score or in use by a run, and this segment has {}: try again "
          "later, or raise max-payload-bytes-per-rig",
          rig_name,
          used,
          limit,
          bytes));
    }
    used -= freed;
  }
  return absl::OkStatus();
}

absl::Status DropOldSegments(Connection* db,
                             std::int64_t rig,
                             const std::string& rig_name,
                             const Quotas& quotas) {
  if (quotas.max_segments_per_rig == 0 && quotas.max_segment_age_s == 0) {
    return absl::OkStatus();
  }
  // The newest stays whatever its age: sequences count on from it.
  Statement read(
      db,
      "SELECT s.segment FROM segments s, "
      "  (SELECT max(sequence) AS newest FROM segments WHERE rig = ?1) "
      "WHERE s.rig = ?1 AND s.sequence < newest AND s.state <> 1 "
      "AND ((?2 > 0 AND s.sequence <= newest - ?2) "
      "  OR (?3 > 0 AND s.receive_time_ns < ?3)) "
      "AND NOT EXISTS (SELECT 1 FROM table_entries e "
      "  WHERE e.segment = s.segment) "
      "AND NOT EXISTS (SELECT 1 FROM run_segments x "
      "  WHERE x.segment = s.segment) "
      "AND NOT EXISTS (SELECT 1 FROM calibration_segments c "
      "  WHERE c.segment = s.segment) "
      "ORDER BY s.sequence LIMIT ?4",
      rig,
      quotas.max_segments_per_rig,
      quotas.max_segment_age_s > 0
          ? NowNs() - quotas.max_segment_age_s * 1'000'000'000
          : std::int64_t{0},
      kMaxDropped);
  std::vector<std::int64_t> dropped;
  while (read.Next()) dropped.push_back(read.Int(0));
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (dropped.empty()) return absl::OkStatus();
  for (const std::int64_t segment : dropped) {
    // Those that still have data are of the reserve for held-out tests.
    for (const char* table : {"payloads",
                              "table_absences",
                              "segment_scores",
                              "segment_information",
                              "segment_ends",
                              "segment_paths",
                              "segments"}) {
      SELFCAL_RETURN_IF_ERROR(
          Statement(db,
                    fmt::format("DELETE FROM {} WHERE segment = ?1", table),
                    segment)
              .Run());
    }
  }
  return AppendEvent(
      db,
      rig_name,
      EventKind::kDataEvicted,
      fmt::format("metadata of {} segments that nothing refers to was dropped: "
                  "older or more than the rig keeps",
                  dropped.size()));
}

}  // namespace selfcal::server
