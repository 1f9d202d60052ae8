#include "server/domain/offers.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "server/domain/quarantine.h"
#include "server/status/status_macros.h"
#include "server/store/exclusions.h"
#include "server/store/rigs.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

std::optional<TableUpdate> OfferToGroup(const Rig& rig,
                                        const SegmentRow& segment,
                                        const SegmentInformation& information,
                                        Table* table) {
  const GroupScore* score = FindGroup(information, table->group);
  if (score == nullptr) return std::nullopt;
  return Offer({segment.key,
                segment.sequence,
                score->entropy,
                score->gain,
                segment.temperature_c},
               rig.min_gain_nats,
               table,
               TemperatureBinOf(rig));
}

std::vector<SegmentKey> KeysOf(std::span<const Candidate> candidates) {
  std::vector<SegmentKey> keys;
  for (const Candidate& candidate : candidates) keys.push_back(candidate.key);
  return keys;
}

std::vector<TableEntry> InOrderOfArrival(std::vector<TableEntry> entries) {
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
    return a.sequence < b.sequence;
  });
  return entries;
}

absl::StatusOr<Candidate> ReadCandidate(UnitOfWork* tx,
                                        const Rig& rig,
                                        const TableEntry& entry) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredSegment segment,
                           ReadSegment(tx, entry.key));
  return MakeCandidate(
      rig, entry.key, entry.sequence, segment.information.value());
}

// The kept segments of a joint selection, in order of arrival. A segment whose
// information is damaged cannot be compared with others and becomes unusable.
absl::StatusOr<std::vector<Candidate>> ReadKept(UnitOfWork* tx,
                                                const Rig& rig,
                                                Table* table) {
  std::vector<Candidate> kept;
  for (const TableEntry& entry : InOrderOfArrival(table->entries)) {
    auto candidate = ReadCandidate(tx, rig, entry);
    if (absl::IsDataLoss(candidate.status())) {
      SELFCAL_ASSIGN_OR_RETURN(const SegmentRow row,
                               FindSegment(tx, entry.key));
      SELFCAL_RETURN_IF_ERROR(
          Quarantine(tx,
                     row,
                     EventKind::kSegmentUnusable,
                     std::string(candidate.status().message())));
      std::erase_if(table->entries,
                    [&](const TableEntry& e) { return e.key == entry.key; });
      continue;
    }
    SELFCAL_RETURN_IF_ERROR(candidate.status());
    kept.push_back(*std::move(candidate));
  }
  return kept;
}

bool HoldsWhatItHeld(const Table& table, const JointDecision& decided) {
  const std::vector<TableEntry> entries = InOrderOfArrival(table.entries);
  return std::equal(entries.begin(),
                    entries.end(),
                    decided.kept.begin(),
                    decided.kept.end(),
                    [](const TableEntry& entry, const SegmentKey& key) {
                      return entry.key == key;
                    });
}

absl::StatusOr<TableUpdate> OfferJointly(
    UnitOfWork* tx,
    const Rig& rig,
    const SegmentRow& segment,
    const SegmentInformation& information,
    const std::optional<JointDecision>& decided,
    Table* table) {
  const Candidate candidate =
      MakeCandidate(rig, segment.key, segment.sequence, information);
  if (decided && HoldsWhatItHeld(*table, *decided)) {
    return Apply(rig, candidate, decided->change, decided->kept, table);
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Candidate> kept,
                           ReadKept(tx, rig, table));
  return Apply(rig,
               candidate,
               Decide(rig, candidate, kept, *table),
               KeysOf(kept),
               table);
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
    const std::int64_t evicted = change.evicted->sequence;
    SELFCAL_RETURN_IF_ERROR(DeleteEntry(tx, table.group, evicted));
    SELFCAL_RETURN_IF_ERROR(
        WriteExclusion(tx,
                       evicted,
                       table.group,
                       {.cause = ExclusionCause::kReplaced,
                        .rival = segment.sequence,
                        .rival_entropy = EntryOf(table, segment.key).entropy}));
  }
  if (!change.inserted) return absl::OkStatus();
  const TableEntry& entry = EntryOf(table, segment.key);
  return InsertEntry(
      tx, table.group, segment.sequence, entry.entropy, entry.gain);
}

// Records why a table refused the segment.
absl::Status ExplainRefusal(UnitOfWork* tx,
                            const Rig& rig,
                            const SegmentRow& segment,
                            const SegmentInformation& information,
                            const std::optional<TableEntry>& rival_entry,
                            const Table& table) {
  const GroupScore* score = FindGroup(information, table.group);
  const bool outranked = score != nullptr && std::isfinite(score->entropy) &&
                         score->gain >= rig.min_gain_nats &&
                         !table.entries.empty();
  if (!outranked) {
    return WriteExclusion(tx,
                          segment.sequence,
                          table.group,
                          {.cause = ExclusionCause::kInsufficientGain});
  }
  const TableEntry& worst = rival_entry.value_or(table.entries.back());
  return WriteExclusion(tx,
                        segment.sequence,
                        table.group,
                        {.cause = ExclusionCause::kOutranked,
                         .rival = worst.sequence,
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

absl::StatusOr<std::optional<JointDecision>> DecideJointly(
    UnitOfWork* tx,
    const SegmentKey& key,
    const SegmentInformation& information) {
  std::optional<JointDecision> decided;
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig stored, ReadRig(tx));
  const Rig& rig = stored.rig;
  if (rig.selection == Selection::kTables) return decided;
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow segment, FindSegment(tx, key));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables, ReadTables(tx));
  const Table& table = tables.at(0);
  std::vector<Candidate> kept;
  for (const TableEntry& entry : InOrderOfArrival(table.entries)) {
    auto candidate = ReadCandidate(tx, rig, entry);
    if (absl::IsDataLoss(candidate.status())) return decided;
    SELFCAL_RETURN_IF_ERROR(candidate.status());
    kept.push_back(*std::move(candidate));
  }
  const Candidate candidate =
      MakeCandidate(rig, segment.key, segment.sequence, information);
  decided = {.kept = KeysOf(kept),
             .change = Decide(rig, candidate, kept, table)};
  return decided;
}

absl::StatusOr<std::vector<std::string>> OfferToTables(
    UnitOfWork* tx,
    const Rig& rig,
    const SegmentRow& segment,
    const SegmentInformation& information,
    const std::optional<JointDecision>& decided,
    std::vector<Table>* tables) {
  std::vector<std::string> entered;
  for (Table& table : *tables) {
    std::optional<TableUpdate> change;
    if (rig.selection == Selection::kTables) {
      change = OfferToGroup(rig, segment, information, &table);
    } else {
      SELFCAL_ASSIGN_OR_RETURN(
          change, OfferJointly(tx, rig, segment, information, decided, &table));
    }
    if (!change) continue;
    SELFCAL_RETURN_IF_ERROR(WriteOffer(tx, segment, *change, table));
    if (change->inserted) {
      entered.push_back(table.group);
    } else if (!change->evicted) {
      SELFCAL_RETURN_IF_ERROR(
          ExplainRefusal(tx, rig, segment, information, change->rival, table));
    }
  }
  return entered;
}

}  // namespace selfcal::server
