#include "server/store/quarantine.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "server/store/absences.h"
#include "server/store/changes.h"
#include "server/store/events.h"
#include "server/store/rigs.h"
#include "server/store/segment_ends.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

struct NamedRow {
  SegmentKey key;
  SegmentRow row;
};

// Of a session in order of arrival, or the one with this index.
absl::StatusOr<std::vector<NamedRow>> RowsOfSession(
    Connection* db,
    std::int64_t rig,
    const std::string& session,
    std::optional<std::int64_t> index) {
  Statement read(db,
                 "SELECT segment, sequence, state, session_index "
                 "FROM segments WHERE rig = ?1 AND session = ?2 "
                 "AND (?3 IS NULL OR session_index = ?3) ORDER BY sequence",
                 rig,
                 session,
                 index);
  std::vector<NamedRow> rows;
  while (read.Next()) {
    rows.push_back({{session, read.Int(3)},
                    {read.Int(0),
                     read.Int(1),
                     static_cast<SegmentState>(read.Int(2) - 1)}});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return rows;
}

absl::Status NothingStored(const std::string& rig,
                           const std::string& session,
                           std::optional<std::int64_t> index) {
  return absl::NotFoundError(
      index
          ? fmt::format("{} is not stored", SegmentText(rig, {session, *index}))
          : fmt::format(
                "no segment of session {} of rig {} is stored", session, rig));
}

}  // namespace

absl::Status MakeUnusable(Connection* db,
                          std::int64_t segment,
                          const std::string& problem) {
  SELFCAL_RETURN_IF_ERROR(WriteProblem(db, segment, problem));
  SELFCAL_RETURN_IF_ERROR(ForgetSegment(db, segment));
  return RemoveFromTables(db, segment, AbsenceCause::kUnusable);
}

absl::Status SetAside(Connection* db,
                      const std::string& rig,
                      const SegmentKey& key,
                      std::int64_t segment,
                      EventKind event,
                      const std::string& problem) {
  SELFCAL_RETURN_IF_ERROR(MakeUnusable(db, segment, problem));
  return AppendEvent(
      db, rig, event, fmt::format("{}: {}", SegmentText(rig, key), problem));
}

absl::Status QuarantineExcluded(Connection* db,
                                std::int64_t rig,
                                const StoredRun& run,
                                const std::vector<SegmentFit>& fits) {
  for (const SegmentFit& fit : fits) {
    if (fit.excluded.empty()) continue;
    const auto found = FindSegment(db, rig, fit.key);
    // One that is not kept any more is no reason to lose the calibration.
    if (absl::IsNotFound(found.status())) continue;
    SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment, found);
    SELFCAL_RETURN_IF_ERROR(
        Statement(db,
                  "UPDATE run_segments SET excluded = 1 "
                  "WHERE rig = ?1 AND run = ?2 AND segment = ?3",
                  rig,
                  run.run,
                  segment.rowid)
            .Run());
    if (segment.state == SegmentState::kUnusable) continue;
    const std::string problem =
        fmt::format("quarantined by run {}: {}", run.run, fit.excluded);
    SELFCAL_RETURN_IF_ERROR(SetAside(db,
                                     run.rig,
                                     fit.key,
                                     segment.rowid,
                                     EventKind::kSegmentQuarantined,
                                     problem));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<SegmentKey>> UnusableSegments(Connection* db,
                                                         std::int64_t rig,
                                                         std::int64_t run) {
  Statement read(db,
                 "SELECT s.session, s.session_index FROM run_segments x "
                 "JOIN segments s USING (segment) "
                 "WHERE x.rig = ?1 AND x.run = ?2 AND s.state = 3 "
                 "ORDER BY s.sequence",
                 rig,
                 run);
  std::vector<SegmentKey> keys;
  while (read.Next()) {
    keys.push_back({read.Text(0), read.Int(1)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return keys;
}

absl::Status MarkUnusableRow(Connection* db,
                             const std::string& rig,
                             const SegmentKey& key,
                             const std::string& problem) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment,
                           FindSegment(db, rig_id, key));
  if (segment.state == SegmentState::kUnusable) {
    return absl::OkStatus();
  }
  SELFCAL_RETURN_IF_ERROR(SetAside(
      db, rig, key, segment.rowid, EventKind::kSegmentUnusable, problem));
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig_id));
  return transaction.Commit();
}

absl::StatusOr<QuarantineCommit> QuarantineSegmentRows(
    Connection* db,
    const std::string& rig,
    const std::string& session,
    std::optional<std::int64_t> index,
    const std::string& caller,
    const std::string& reason) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<NamedRow> named,
                           RowsOfSession(db, rig_id, session, index));
  if (named.empty()) return NothingStored(rig, session, index);
  QuarantineCommit commit;
  for (const NamedRow& segment : named) {
    if (segment.row.state == SegmentState::kUnusable) {
      ++commit.unusable;
      continue;
    }
    ++commit.quarantined;
    if (segment.row.state == SegmentState::kStored) {
      commit.unscored_sequences.push_back(segment.row.sequence);
    }
    SELFCAL_RETURN_IF_ERROR(
        MakeUnusable(db,
                     segment.row.rowid,
                     fmt::format("quarantined by {}: {}", caller, reason)));
  }
  if (commit.quarantined == 0) return commit;
  const std::string what =
      index ? SegmentText(rig, named.front().key)
            : fmt::format("{} segments of session {} of rig {}",
                          commit.quarantined,
                          session,
                          rig);
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(db,
                  rig,
                  EventKind::kSegmentQuarantined,
                  fmt::format("{} by {}: {}", what, caller, reason)));
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig_id));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return commit;
}

}  // namespace selfcal::server
