// What happens to a stored segment: it gets its score.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/selection/joint_selection.h"
#include "server/store/absences.h"
#include "server/store/change_rows.h"
#include "server/store/changes.h"
#include "server/store/fit_rows.h"
#include "server/store/quarantine.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_ends.h"
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

// Offers the segment to the table of its group.
std::optional<TableChange> OfferToGroup(const Rig& rig,
                                        const SegmentRow& segment,
                                        const SegmentKey& key,
                                        const SegmentInformation& information,
                                        Table* table) {
  const GroupScore* score = FindGroup(information, table->group);
  if (score == nullptr) return std::nullopt;
  return Offer({key, segment.sequence, score->entropy, score->gain},
               rig.min_gain_nats,
               table);
}

// The kept segments of a joint selection, in order of arrival. One whose
// information is damaged is set aside: it can be compared with nothing.
absl::StatusOr<std::vector<Candidate>> ReadKept(Connection* db,
                                                const RigRow& rig,
                                                Table* table) {
  std::vector<Candidate> kept;
  std::vector<TableEntry> readable;
  for (const TableEntry& entry : table->entries) {
    const auto segment = ReadSegment(db, rig.stored.rig.id, entry.key);
    if (absl::IsDataLoss(segment.status())) {
      SELFCAL_ASSIGN_OR_RETURN(const SegmentRow row,
                               FindSegment(db, rig.rowid, entry.key));
      SELFCAL_RETURN_IF_ERROR(
          SetAside(db,
                   rig.stored.rig.id,
                   entry.key,
                   row.rowid,
                   EventKind::kSegmentUnusable,
                   std::string(segment.status().message())));
      continue;
    }
    SELFCAL_RETURN_IF_ERROR(segment.status());
    kept.push_back(MakeCandidate(rig.stored.rig,
                                 entry.key,
                                 entry.sequence,
                                 segment->information.value()));
    readable.push_back(entry);
  }
  table->entries = std::move(readable);
  std::sort(kept.begin(), kept.end(), [](const auto& a, const auto& b) {
    return a.sequence < b.sequence;
  });
  return kept;
}

absl::StatusOr<TableChange> OfferJointly(Connection* db,
                                         const RigRow& rig,
                                         const SegmentRow& segment,
                                         const SegmentKey& key,
                                         const SegmentInformation& information,
                                         Table* table) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Candidate> kept,
                           ReadKept(db, rig, table));
  return Offer(
      rig.stored.rig,
      MakeCandidate(rig.stored.rig, key, segment.sequence, information),
      kept,
      table);
}

// Writes down why what is not in the table after an offer is not.
absl::Status ExplainOffer(Connection* db,
                          const RigRow& rig,
                          const SegmentKey& key,
                          const SegmentRow& segment,
                          const SegmentInformation& information,
                          const TableChange& change,
                          const Table& table) {
  if (change.evicted) {
    const auto in = std::find_if(table.entries.begin(),
                                 table.entries.end(),
                                 [&](const auto& e) { return e.key == key; });
    SELFCAL_ASSIGN_OR_RETURN(const SegmentRow evicted,
                             FindSegment(db, rig.rowid, change.evicted->key));
    return WriteAbsence(db,
                        evicted.rowid,
                        table.group,
                        AbsenceCause::kPushedOut,
                        segment.rowid,
                        in->entropy);
  }
  if (change.inserted) return absl::OkStatus();
  const GroupScore* score = FindGroup(information, table.group);
  const bool lost = score != nullptr && std::isfinite(score->entropy) &&
                    score->gain >= rig.stored.rig.min_gain_nats &&
                    !table.entries.empty();
  if (!lost) {
    return WriteAbsence(db,
                        segment.rowid,
                        table.group,
                        AbsenceCause::kSaysTooLittle,
                        std::nullopt,
                        std::nullopt);
  }
  const TableEntry& worst = table.entries.back();
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow rival,
                           FindSegment(db, rig.rowid, worst.key));
  return WriteAbsence(db,
                      segment.rowid,
                      table.group,
                      AbsenceCause::kOthersSayMore,
                      rival.rowid,
                      worst.entropy);
}

// Offers the segment to every table.
absl::StatusOr<std::vector<std::string>> OfferToTables(
    Connection* db,
    const RigRow& rig,
    const SegmentRow& segment,
    const SegmentKey& key,
    const SegmentInformation& information,
    std::vector<Table>* tables) {
  std::vector<std::string> entered;
  for (Table& table : *tables) {
    std::optional<TableChange> change;
    if (rig.stored.rig.selection == Selection::kTables) {
      change = OfferToGroup(rig.stored.rig, segment, key, information, &table);
    } else {
      SELFCAL_ASSIGN_OR_RETURN(
          change, OfferJointly(db, rig, segment, key, information, &table));
    }
    if (!change) continue;
    SELFCAL_RETURN_IF_ERROR(WriteOffer(db, rig.rowid, key, *change, table));
    SELFCAL_RETURN_IF_ERROR(
        ExplainOffer(db, rig, key, segment, information, *change, table));
    if (change->inserted) {
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
    const std::optional<SegmentEnds>& ends,
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
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t receive_time_ns,
                           ReceiveTime(db, segment.rowid));
  SELFCAL_RETURN_IF_ERROR(WriteScore(db, segment.rowid, information));
  if (ends) {
    SELFCAL_RETURN_IF_ERROR(WriteEnds(db, rig.rowid, segment.rowid, *ends));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::optional<double> largest_fit,
                           ReadLargestFit(db, rig.rowid));
  SELFCAL_RETURN_IF_ERROR(RemoveMisfits(db, rig.rowid, largest_fit));
  SELFCAL_ASSIGN_OR_RETURN(std::vector<Table> tables,
                           ReadFreshTables(db, rig, receive_time_ns));
  SELFCAL_ASSIGN_OR_RETURN(
      const bool admitted,
      AdmitByFit(
          db, rig.rowid, segment.rowid, information.residuals, largest_fit));
  if (admitted) {
    SELFCAL_ASSIGN_OR_RETURN(
        commit.tables,
        OfferToTables(db, rig, segment, key, information, &tables));
  }
  SELFCAL_ASSIGN_OR_RETURN(const NewestJudged judged,
                           JudgeNewest(db, rig, change));
  commit.change = judged.change;
  if (judged.change || judged.quarantined > 0) {
    SELFCAL_ASSIGN_OR_RETURN(tables, ReadTables(db, rig.rowid));
    SELFCAL_ASSIGN_OR_RETURN(commit.tables, TablesOfSegment(db, segment.rowid));
  }
  SELFCAL_ASSIGN_OR_RETURN(commit.started_run, MaybeInsertRun(db, rig, tables));
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig.rowid));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return commit;
}

absl::Status ReplaceScoreRows(Connection* db,
                              const std::string& rig_name,
                              const SegmentKey& key,
                              const SegmentInformation& information,
                              const SegmentEnds& ends) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const RigRow rig, ReadRig(db, rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment,
                           FindSegment(db, rig.rowid, key));
  SELFCAL_ASSIGN_OR_RETURN(const bool has_data, HasData(db, segment.rowid));
  if (segment.state != SegmentState::kScored || !has_data) {
    return absl::OkStatus();
  }
  SELFCAL_RETURN_IF_ERROR(WriteScore(db, segment.rowid, information));
  SELFCAL_RETURN_IF_ERROR(WriteEnds(db, rig.rowid, segment.rowid, ends));
  // What entries of a joint selection say is of all of them together.
  const bool by_score = rig.stored.rig.selection == Selection::kTables;
  for (const GroupScore& score : information.groups) {
    if (!by_score || !std::isfinite(score.entropy)) continue;
    SELFCAL_RETURN_IF_ERROR(WriteEntryScore(db, segment.rowid, score));
  }
  return transaction.Commit();
}

}  // namespace selfcal::server
