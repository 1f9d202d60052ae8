// The tables of section IV-B: for each group the N segments of lowest entropy.
// Values and pure functions; storage is the caller's concern.
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
  // Order of arrival in the rig; the older wins ties in entropy.
  std::int64_t sequence = 0;
  double entropy = 0;  // [nat]
  double gain = 0;     // [nat]
  // Temperature of the device [deg C], if the segment states one.
  std::optional<double> temperature_c = std::nullopt;

  friend bool operator==(const TableEntry&, const TableEntry&) = default;
};

// The order of a table: lower entropy first, then the older, so that a replay
// of the same segments in the same order gives the same table.
bool Better(const TableEntry& a, const TableEntry& b);

struct Table {
  std::string group;
  int capacity = 0;                 // N_q
  std::vector<TableEntry> entries;  // sorted by Better()
  std::int64_t scored = 0;          // number of segments that were offered

  bool full() const { return static_cast<int>(entries.size()) >= capacity; }
  // Not full although 10 N segments were offered; runs no longer wait for it,
  // unless it is that of a joint selection.
  bool starved() const {
    return !full() && scored >= 10 * static_cast<std::int64_t>(capacity);
  }
};

// Empty tables of a rig: one for each of its groups; with a joint selection a
// single one, whose entries are those that Offer() of joint_selection.h keeps,
// with the entropy of all of theta.
std::vector<Table> MakeTables(const Rig& rig);

struct TableUpdate {
  bool inserted = false;
  std::optional<TableEntry> evicted;
  // The entry that outranks a candidate that is good enough otherwise.
  std::optional<TableEntry> rival;
};

// Width of a bin of temperatures [K], for rigs that estimate slopes with
// temperature: only segments of different temperatures determine these. Zero
// for other rigs, whose segments are all in one bin.
inline constexpr double kTemperatureBin_k = 10;
double TemperatureBinOf(const Rig& rig);

// Offers one scored segment to a table, and counts it. It enters if its gain is
// at least min_gain_nats and it is among the N best. With bins of temperatures,
// each of the B bins in question has a share of N / B entries (at least one): a
// candidate whose bin has less replaces the worst of the bins that have more
// than their share; any other competes with the entries of its own bin, or, if
// that has none and no other has more than its share, with all. A key that is
// already in the table changes nothing and is not counted. A segment with an
// entropy or gain that is not finite is counted and never enters. Without bins,
// an evicted segment cannot return: the entries that displaced it are better,
// or equal and older.
TableUpdate Offer(const TableEntry& candidate,
                  double min_gain_nats,
                  Table* table,
                  double temperature_bin_k = 0);

// All keys in at least one table, once each, sorted by sequence.
std::vector<TableEntry> UnionOfTables(const std::vector<Table>& tables);

enum class Trigger {
  kNone,
  kTablesFull,     // for the first time
  kTablesChanged,  // enough entries since the last run
};

// Decides whether a run should start. `last_run` is the snapshot of the last
// run, including the segments that its result excluded; nullopt if there was
// none. Tables are ready when each is full or starved, and at least one is
// full; the table of a joint selection, which is as large as all tables of the
// groups together, is ready as soon as one of those would be. Then the first
// run starts; a later one starts when, counted over all tables, at least
// rig.retrigger_fraction of the entries (and at least one) are of segments that
// the last run was not created with.
Trigger EvaluateTrigger(const Rig& rig,
                        const std::vector<Table>& tables,
                        const std::optional<std::vector<SegmentKey>>& last_run);

}  // namespace selfcal
