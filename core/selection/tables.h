// The tables of section IV-B: for each group the N segments of lowest entropy.
// Values and pure functions; who stores them is not known here.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct TableEntry {
  SegmentKey key;
  // Order of arrival in the rig; ties in entropy go to the older.
  std::int64_t sequence = 0;
  double entropy = 0;  // [nat]
  double gain = 0;     // [nat]

  friend bool operator==(const TableEntry&, const TableEntry&) = default;
};

// The order of a table: richer first; the older of two that are as rich, so
// that a replay of the same segments in the same order gives the same table.
bool Better(const TableEntry& a, const TableEntry& b);

struct Table {
  std::string group;
  int capacity = 0;                 // N_q
  std::vector<TableEntry> entries;  // sorted by Better()
  std::int64_t scored = 0;          // segments that were offered

  bool full() const { return static_cast<int>(entries.size()) >= capacity; }
  // Not full although 10 N segments were offered: no longer waited for.
  bool starved() const {
    return !full() && scored >= 10 * static_cast<std::int64_t>(capacity);
  }
};

// Empty tables of a rig: one for each of its groups; with a joint selection one
// for all, whose entries are those that Offer() of joint_selection.h keeps, by
// the entropy of all of theta.
std::vector<Table> MakeTables(const Rig& rig);

struct TableChange {
  bool inserted = false;
  std::optional<TableEntry> evicted;
};

// Offers one scored segment to a table, and counts it. It enters if it gains at
// least min_gain_nats and is among the N best. A key that the table has already
// changes nothing and is not counted. An entropy or gain that is not finite is
// counted and never enters. What was evicted cannot come back: the entries that
// displaced it are better, or as good and older.
TableChange Offer(const TableEntry& candidate,
                  double min_gain_nats,
                  Table* table);

// Every key in at least one table, once, sorted by sequence.
std::vector<TableEntry> UnionOfTables(const std::vector<Table>& tables);

enum class Trigger {
  kNone,
  kTablesFull,     // for the first time
  kTablesChanged,  // enough of them since the last run
};

// Whether a run should start. `last_run` holds the keys that the last run used,
// nothing if there was none. Tables are ready when each is full or starved, and
// at least one is full; that of a joint selection, which is as large as all
// tables of the groups together, is as soon as one of those would be. Then the
// first run starts, and a later one when, counted over all tables, at least
// rig.retrigger_fraction of the entries (and at least one) are of segments that
// the last run did not use.
Trigger EvaluateTrigger(const Rig& rig,
                        const std::vector<Table>& tables,
                        const std::optional<std::vector<SegmentKey>>& last_run);

}  // namespace selfcal
