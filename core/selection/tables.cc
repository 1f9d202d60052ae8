#include "core/selection/tables.h"

#include <algorithm>
#include <cmath>
#include <set>

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

}  // namespace

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
                  Table* table) {
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
  if (table->full() && !Better(candidate, entries.back())) {
    return change;
  }
  entries.insert(
      std::upper_bound(entries.begin(), entries.end(), candidate, Better),
      candidate);
  change.inserted = true;
  if (static_cast<int>(entries.size()) > table->capacity) {
    change.evicted = entries.back();
    entries.pop_back();
  }
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
