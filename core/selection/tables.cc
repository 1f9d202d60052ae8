#include "core/selection/tables.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

bool Ready(const Rig& rig, const std::vector<Table>& tables) {
  if (rig.selection != Selection::kTables) {
    return !tables.empty() &&
           static_cast<int>(tables[0].entries.size()) >= rig.table_size;
  }
  bool any_full = false;
  for (const Table& table : tables) {
    if (!table.full() && !table.starved()) {
      return false;
    }
    any_full |= table.full();
  }
  return any_full;
}

// All of one bin without a width, or without a temperature.
int BinOf(const TableEntry& entry, double width_k) {
  if (width_k <= 0 || !entry.temperature_c) return 0;
  return static_cast<int>(std::floor(*entry.temperature_c / width_k));
}

// The entry of a full table that a candidate may replace: in any case, or only
// if the candidate is better.
struct Rival {
  TableEntry entry;
  bool yields;
};

Rival RivalOf(const TableEntry& candidate,
              const std::vector<TableEntry>& entries,
              double width_k) {
  std::map<int, int> counts;
  for (const TableEntry& entry : entries) ++counts[BinOf(entry, width_k)];
  const int own = BinOf(candidate, width_k);
  const int own_count = counts[own];
  const int share = std::max<int>(
      1, static_cast<int>(entries.size()) / static_cast<int>(counts.size()));
  // The worst of those in bins that meet a condition.
  const auto worst = [&](const auto& meets) {
    return std::find_if(entries.rbegin(), entries.rend(), [&](const auto& e) {
      return meets(BinOf(e, width_k));
    });
  };
  const auto of_large = worst([&](int bin) { return counts[bin] > share; });
  if (own_count < share && of_large != entries.rend()) return {*of_large, true};
  const auto of_own = worst([&](int bin) { return bin == own; });
  return {of_own != entries.rend() ? *of_own : entries.back(), false};
}

}  // namespace

double TemperatureBinOf(const Rig& rig) {
  const std::vector<std::string> blocks = ComponentBlocks(rig.factory);
  const std::vector<int> free = FreeComponents(rig);
  const bool slopes = std::any_of(free.begin(), free.end(), [&](int i) {
    return blocks[i].ends_with(kSlopeSuffix);
  });
  return slopes ? kTemperatureBin_k : 0;
}

bool Better(const TableEntry& a, const TableEntry& b) {
  if (a.entropy != b.entropy) {
    return a.entropy < b.entropy;
  }
  return a.sequence < b.sequence;
}

std::vector<Table> MakeTables(const Rig& rig) {
  std::vector<Table> tables;
  if (rig.selection != Selection::kTables) {
    Table table;
    table.group = kJointTable;
    table.capacity = static_cast<int>(rig.groups.size()) * rig.table_size;
    tables.push_back(std::move(table));
    return tables;
  }
  tables.reserve(rig.groups.size());
  for (const ParameterGroup& group : rig.groups) {
    Table table;
    table.group = group.name;
    table.capacity = rig.table_size;
    tables.push_back(std::move(table));
  }
  return tables;
}

TableUpdate Offer(const TableEntry& candidate,
                  double min_gain_nats,
                  Table* table,
                  double temperature_bin_k) {
  TableUpdate change;
  std::vector<TableEntry>& entries = table->entries;
  for (const TableEntry& entry : entries) {
    if (entry.key == candidate.key) {
      return change;
    }
  }
  ++table->scored;
  if (!std::isfinite(candidate.entropy) || !std::isfinite(candidate.gain) ||
      candidate.gain < min_gain_nats || table->capacity <= 0) {
    return change;
  }
  if (table->full()) {
    const Rival rival = RivalOf(candidate, entries, temperature_bin_k);
    if (!rival.yields && !Better(candidate, rival.entry)) {
      change.rival = rival.entry;
      return change;
    }
    std::erase(entries, rival.entry);
    change.evicted = rival.entry;
  }
  entries.insert(
      std::upper_bound(entries.begin(), entries.end(), candidate, Better),
      candidate);
  change.inserted = true;
  return change;
}

std::vector<TableEntry> UnionOfTables(const std::vector<Table>& tables) {
  std::vector<TableEntry> all;
  std::set<SegmentKey> seen;
  for (const Table& table : tables) {
    for (const TableEntry& entry : table.entries) {
      if (seen.insert(entry.key).second) {
        all.push_back(entry);
      }
    }
  }
  std::sort(
      all.begin(), all.end(), [](const TableEntry& a, const TableEntry& b) {
        return a.sequence < b.sequence;
      });
  return all;
}

Trigger EvaluateTrigger(
    const Rig& rig,
    const std::vector<Table>& tables,
    const std::optional<std::vector<SegmentKey>>& last_run) {
  if (!Ready(rig, tables)) {
    return Trigger::kNone;
  }
  if (!last_run) {
    return Trigger::kTablesFull;
  }
  const std::set<SegmentKey> used(last_run->begin(), last_run->end());
  int total = 0;
  int fresh = 0;
  for (const Table& table : tables) {
    for (const TableEntry& entry : table.entries) {
      ++total;
      fresh += used.contains(entry.key) ? 0 : 1;
    }
  }
  const bool enough = fresh > 0 && fresh >= rig.retrigger_fraction * total;
  return enough ? Trigger::kTablesChanged : Trigger::kNone;
}

}  // namespace selfcal
