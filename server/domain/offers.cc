#include "server/domain/offers.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/selection/joint_selection.h"
#include "server/domain/quarantine.h"
#include "server/status/status_macros.h"
#include "server/store/exclusions.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

std::optional<TableUpdate> OfferToGroup(const Rig& rig,
                                        const SegmentRow& segment,
                                        const SegmentInformation& information,
                                        Table* table) {
  const GroupScore* score = FindGroup(information, table->group);
  if (score == nullptr) return std::nullopt;
  return Offer({segment.key, segment.sequence, score->entropy, score->gain},
               rig.min_gain_nats,
               table);
}

// The kept segments of a joint selection, in order of arrival. A segment whose
// information is damaged cannot be compared with others and becomes unusable.
absl::StatusOr<std::vector<Candidate>> ReadKept(UnitOfWork* tx,
                                                const Rig& rig,
                                                Table* table) {
  std::vector<Candidate> kept;
  std::vector<TableEntry> readable;
  for (const TableEntry& entry : table->entries) {
    const auto segment = ReadSegment(tx, entry.key);
    if (absl::IsDataLoss(segment.status())) {
      SELFCAL_ASSIGN_OR_RETURN(const SegmentRow row,
                               FindSegment(tx, entry.key));
      SELFCAL_RETURN_IF_ERROR(
          Quarantine(tx,
                     row,
                     EventKind::kSegmentUnusable,
                     std::string(segment.status().message())));
      continue;
    }
    SELFCAL_RETURN_IF_ERROR(segment.status());
    kept.push_back(MakeCandidate(
        rig, entry.key, entry.sequence, segment->information.value()));
    readable.push_back(entry);
  }
  table->entries = std::move(readable);
  std::sort(kept.begin(), kept.end(), [](const auto& a, const auto& b) {
    return a.sequence < b.sequence;
  });
  return kept;
}

const TableEntry& EntryOf(const Table& table, const SegmentKey& key) {
  return *std::find_if(table.entries.begin(),
                       table.entries.end(),
                       [&](const TableEntry& e) { return e.key == key; });
}

// Writes the table update of an offer.
absl::Status WriteOffer(UnitOfWork* tx,
                        const SegmentRow& segment,
                        const TableUpdate& change,
                        const Table& table) {
  SELFCAL_RETURN_IF_ERROR(WriteScored(tx, table.group, table.scored));
  if (change.evicted) {
    SELFCAL_ASSIGN_OR_RETURN(const SegmentRow evicted,
                             FindSegment(tx, change.evicted->key));
    SELFCAL_RETURN_IF_ERROR(DeleteEntry(tx, table.group, evicted.rowid));
    SELFCAL_RETURN_IF_ERROR(
        WriteExclusion(tx,
                       evicted.rowid,
                       table.group,
                       {.cause = ExclusionCause::kReplaced,
                        .rival = segment.rowid,
                        .rival_entropy = EntryOf(table, segment.key).entropy}));
  }
  if (!change.inserted) return absl::OkStatus();
  const TableEntry& entry = EntryOf(table, segment.key);
  return InsertEntry(tx, table.group, segment.rowid, entry.entropy, entry.gain);
}

// Records why a table refused the segment.
absl::Status ExplainRefusal(UnitOfWork* tx,
                            const Rig& rig,
                            const SegmentRow& segment,
                            const SegmentInformation& information,
                            const Table& table) {
  const GroupScore* score = FindGroup(information, table.group);
  const bool outranked = score != nullptr && std::isfinite(score->entropy) &&
                         score->gain >= rig.min_gain_nats &&
                         !table.entries.empty();
  if (!outranked) {
    return WriteExclusion(tx,
                          segment.rowid,
                          table.group,
                          {.cause = ExclusionCause::kInsufficientGain});
  }
  const TableEntry& worst = table.entries.back();
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow rival, FindSegment(tx, worst.key));
  return WriteExclusion(tx,
                        segment.rowid,
                        table.group,
                        {.cause = ExclusionCause::kOutranked,
                         .rival = rival.rowid,
                         .rival_entropy = worst.entropy});
}

}  // namespace

const GroupScore* FindGroup(const SegmentInformation& information,
                            const std::string& group) {
  for (const GroupScore& score : information.groups) {
    if (score.group == group) return &score;
  }
  return nullptr;
}

absl::StatusOr<std::vector<std::string>> OfferToTables(
    UnitOfWork* tx,
    const Rig& rig,
    const SegmentRow& segment,
    const SegmentInformation& information,
    std::vector<Table>* tables) {
  std::vector<std::string> entered;
  for (Table& table : *tables) {
    std::optional<TableUpdate> change;
    if (rig.selection == Selection::kTables) {
      change = OfferToGroup(rig, segment, information, &table);
    } else {
      SELFCAL_ASSIGN_OR_RETURN(const std::vector<Candidate> kept,
                               ReadKept(tx, rig, &table));
      change =
          Offer(rig,
                MakeCandidate(rig, segment.key, segment.sequence, information),
                kept,
                &table);
    }
    if (!change) continue;
    SELFCAL_RETURN_IF_ERROR(WriteOffer(tx, segment, *change, table));
    if (change->inserted) {
      entered.push_back(table.group);
    } else if (!change->evicted) {
      SELFCAL_RETURN_IF_ERROR(
          ExplainRefusal(tx, rig, segment, information, table));
    }
  }
  return entered;
}

}  // namespace selfcal::server
