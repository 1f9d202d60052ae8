// What happens to a stored segment: it gets its score, or turns out unusable.
#include <fmt/format.h>

#include "server/store/change_rows.h"
#include "server/store/changes.h"
#include "server/store/events.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

const GroupScore* FindGroup(const SegmentInformation& information,
                            const std::string& group) {
  for (const GroupScore& score : information.groups) {
    if (score.group == group) {
      return &score;
    }
  }
  return nullptr;
}

// Writes the score, and offers the segment to the table of each group.
absl::StatusOr<std::vector<std::string>> ScoreAndOffer(
    Connection* db,
    const RigRow& rig,
    const SegmentRow& segment,
    const SegmentKey& key,
    const SegmentInformation& information,
    std::vector<Table>* tables) {
  SELFCAL_RETURN_IF_ERROR(WriteScore(db, segment.rowid, information));
  std::vector<std::string> entered;
  for (Table& table : *tables) {
    const GroupScore* score = FindGroup(information, table.group);
    if (score == nullptr) {
      continue;
    }
    SELFCAL_ASSIGN_OR_RETURN(
        const bool inserted,
        OfferToTable(db,
                     rig.rowid,
                     segment.rowid,
                     {key, segment.sequence, score->entropy, score->gain},
                     rig.stored.rig.min_gain_nats,
                     &table));
    if (inserted) {
      entered.push_back(table.group);
    }
  }
  return entered;
}

}  // namespace

absl::StatusOr<ScoreCommit> CommitScoreRows(
    Connection* db,
    const std::string& rig_name,
    const SegmentKey& key,
    const SegmentInformation& information,
    const ChangeOptions& change) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const RigRow rig, ReadRig(db, rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment,
                           FindSegment(db, rig.rowid, key));
  ScoreCommit commit;
  if (segment.state == SegmentState::kScored) {
    SELFCAL_ASSIGN_OR_RETURN(commit.tables, TablesOfSegment(db, segment.rowid));
    return commit;
  }
  if (segment.state == SegmentState::kUnusable) {
    return absl::FailedPreconditionError(
        SegmentText(rig_name, key) +
        " was found unusable; send it anew under "
        "another session");
  }
  SELFCAL_ASSIGN_OR_RETURN(std::vector<Table> tables,
                           ReadTables(db, rig.rowid));
  SELFCAL_ASSIGN_OR_RETURN(
      commit.tables,
      ScoreAndOffer(db, rig, segment, key, information, &tables));
  SELFCAL_ASSIGN_OR_RETURN(commit.change, MaybeInsertChange(db, rig, change));
  if (commit.change) {
    SELFCAL_ASSIGN_OR_RETURN(tables, ReadTables(db, rig.rowid));
    SELFCAL_ASSIGN_OR_RETURN(commit.tables, TablesOfSegment(db, segment.rowid));
  }
  SELFCAL_ASSIGN_OR_RETURN(commit.started_run, MaybeInsertRun(db, rig, tables));
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig.rowid));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return commit;
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
  SELFCAL_RETURN_IF_ERROR(WriteProblem(db, segment.rowid, problem));
  SELFCAL_RETURN_IF_ERROR(RemoveFromTables(db, segment.rowid));
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig_id));
  SELFCAL_RETURN_IF_ERROR(
      AppendEvent(db,
                  rig,
                  EventKind::kSegmentUnusable,
                  fmt::format("{}: {}", SegmentText(rig, key), problem)));
  return transaction.Commit();
}

}  // namespace selfcal::server
