#include "core/selection/tables.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <string>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

TableEntry Entry(int id, double entropy, double gain = 10) {
  TableEntry entry;
  entry.key = {"session", id};
  entry.sequence = id;
  entry.entropy = entropy;
  entry.gain = gain;
  return entry;
}

Table MakeTable(int capacity) {
  Table table;
  table.group = "imu";
  table.capacity = capacity;
  return table;
}

// Expected contents of a table after these offers, computed without a table:
// the first offer of every key with sufficient gain, sorted, truncated.
std::vector<TableEntry> BruteForce(const std::vector<TableEntry>& offers,
                                   double min_gain,
                                   int capacity) {
  std::vector<TableEntry> kept;
  for (const TableEntry& offer : offers) {
    if (offer.gain >= min_gain) {
      kept.push_back(offer);
    }
  }
  std::stable_sort(kept.begin(), kept.end(), [](const auto& a, const auto& b) {
    return std::pair(a.entropy, a.sequence) < std::pair(b.entropy, b.sequence);
  });
  if (static_cast<int>(kept.size()) > capacity) {
    kept.resize(capacity);
  }
  return kept;
}

TEST(Tables, RigGivesOneEmptyTableForEachGroup) {
  Rig rig;
  rig.groups = {{"a", {"imu.*"}}, {"b", {"*.focal.x"}}};
  rig.table_size = 5;
  const std::vector<Table> tables = MakeTables(rig);
  ASSERT_EQ(tables.size(), 2u);
  EXPECT_EQ(tables[0].group, "a");
  EXPECT_EQ(tables[1].group, "b");
  for (const Table& table : tables) {
    EXPECT_EQ(table.capacity, 5);
    EXPECT_TRUE(table.entries.empty());
    EXPECT_EQ(table.scored, 0);
    EXPECT_FALSE(table.full());
    EXPECT_FALSE(table.starved());
  }
}

TEST(Tables, HoldTheBestOfAllOffersAsSortingThemWould) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 500; ++trial) {
    const int capacity = 1 + trial % 9;
    // Few distinct entropies, so that there are ties.
    std::uniform_int_distribution<int> entropy(-6, 6);
    std::uniform_real_distribution<double> gain(0, 4);
    Table table = MakeTable(capacity);
    std::vector<TableEntry> offers;
    for (int i = 0; i < 60; ++i) {
      offers.push_back(Entry(i, entropy(random), gain(random)));
      const Table before = table;
      const TableUpdate change = Offer(offers.back(), 1.0, &table);
      const std::vector<TableEntry> expected =
          BruteForce(offers, 1.0, capacity);
      ASSERT_EQ(table.entries, expected);
      ASSERT_EQ(table.scored, i + 1);
      ASSERT_EQ(change.inserted, table.entries != before.entries);
      ASSERT_EQ(change.evicted.has_value(), change.inserted && before.full());
      if (change.evicted) {
        EXPECT_EQ(*change.evicted, before.entries.back());
      }
      // The same segment again, whatever its score, changes nothing.
      if (change.inserted) {
        TableEntry again = offers.back();
        again.entropy -= 1;
        again.sequence += 1000;
        const TableUpdate repeat = Offer(again, 1.0, &table);
        ASSERT_FALSE(repeat.inserted);
        ASSERT_FALSE(repeat.evicted.has_value());
        ASSERT_EQ(table.entries, expected);
        ASSERT_EQ(table.scored, i + 1);
      }
    }
  }
}

TEST(Tables, OfTwoEquallyRichTheOlderStays) {
  Table table = MakeTable(2);
  Offer(Entry(0, 1.0), 1, &table);
  Offer(Entry(1, 1.0), 1, &table);
  EXPECT_FALSE(Offer(Entry(2, 1.0), 1, &table).inserted);
  EXPECT_EQ(table.entries[0].sequence, 0);
  EXPECT_EQ(table.entries[1].sequence, 1);
  const TableUpdate change = Offer(Entry(3, 0.5), 1, &table);
  ASSERT_TRUE(change.evicted.has_value());
  EXPECT_EQ(change.evicted->sequence, 1);
}

TableEntry At(int id, double entropy, double temperature_c) {
  TableEntry entry = Entry(id, entropy);
  entry.temperature_c = temperature_c;
  return entry;
}

std::map<int, int> Bins(const Table& table) {
  std::map<int, int> counts;
  for (const TableEntry& entry : table.entries) {
    ++counts[static_cast<int>(
        std::floor(*entry.temperature_c / kTemperatureBin_k))];
  }
  return counts;
}

TEST(Tables, KeepTemperaturesApartForRigsThatNeedThem) {
  Table table = MakeTable(8);
  int id = 0;
  // The best stay while all have one temperature.
  for (; id < 20; ++id) {
    Offer(At(id, -id, 31), 1, &table, kTemperatureBin_k);
  }
  EXPECT_EQ(table.entries.size(), 8u);
  EXPECT_EQ(table.entries.back().entropy, -12);
  // Poorer segments of another temperature get half of the places, those of the
  // worst; then only better ones of their own temperature.
  for (; id < 30; ++id) {
    const TableUpdate change =
        Offer(At(id, 100 + id, 52), 1, &table, kTemperatureBin_k);
    EXPECT_EQ(change.inserted, id < 24);
    if (change.inserted) {
      EXPECT_EQ(change.evicted->entropy, 8 - id);
    } else {
      EXPECT_EQ(change.rival->entropy, 123);
    }
  }
  EXPECT_EQ(Bins(table), (std::map<int, int>{{3, 4}, {5, 4}}));
  EXPECT_FALSE(Offer(At(40, 0, 33), 1, &table, kTemperatureBin_k).inserted);
  EXPECT_EQ(
      Offer(At(41, 110, 57), 1, &table, kTemperatureBin_k).evicted->entropy,
      123);
  // A third temperature: a share is 8 / 3 = 2.
  for (id = 50; id < 60; ++id) {
    Offer(At(id, 200, 8), 1, &table, kTemperatureBin_k);
  }
  EXPECT_EQ(Bins(table)[0], 2);
  // Without bins, the temperature does not matter.
  EXPECT_TRUE(Offer(At(70, -100, 8), 1, &table).inserted);
}

// However many temperatures there are, the table is not larger, and none that
// has one segment loses it to a temperature that has another.
TEST(Tables, HaveSegmentsOfAsManyTemperaturesAsTheyHavePlaces) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> entropy(-10, 10), celsius(-40, 85);
  for (int trial = 0; trial < 50; ++trial) {
    Table table = MakeTable(6);
    std::size_t distinct = 0;
    for (int id = 0; id < 200; ++id) {
      Offer(At(id, entropy(random), celsius(random)),
            1,
            &table,
            kTemperatureBin_k);
      ASSERT_LE(table.entries.size(), 6u);
      ASSERT_TRUE(
          std::is_sorted(table.entries.begin(), table.entries.end(), Better));
      if (table.full()) {
        ASSERT_GE(Bins(table).size(), distinct);
        distinct = Bins(table).size();
      }
    }
    EXPECT_EQ(distinct, 6u);
  }
}

TEST(Tables, OfARigThatEstimatesSlopesHaveBins) {
  Rig rig = HandheldRig("r");
  EXPECT_EQ(TemperatureBinOf(rig), 0);
  rig.factory.imu.s_g_slope = Eigen::Vector3d::Constant(1e-4);
  EXPECT_EQ(TemperatureBinOf(rig), 0) << "known slopes need no temperatures";
  rig.blocks = {{"imu.gyro.scale_slope", true}};
  EXPECT_EQ(TemperatureBinOf(rig), kTemperatureBin_k);
}

TEST(Tables, AnEvictedSegmentCannotComeBack) {
  Table table = MakeTable(1);
  Offer(Entry(0, 2.0), 1, &table);
  Offer(Entry(1, 1.0), 1, &table);
  TableEntry again = Entry(0, 2.0);
  again.sequence = 2;
  EXPECT_FALSE(Offer(again, 1, &table).inserted);
  EXPECT_EQ(table.entries[0].sequence, 1);
}

TEST(Tables, TheMinimumGainItselfIsEnoughAndLessIsNot) {
  Table table = MakeTable(3);
  EXPECT_TRUE(Offer(Entry(0, 5.0, 1.0), 1.0, &table).inserted);
  EXPECT_FALSE(Offer(Entry(1, -5.0, 0.999), 1.0, &table).inserted);
  EXPECT_EQ(table.scored, 2);
}

TEST(Tables, ScoresThatAreNotFiniteAreCountedButNeverEnter) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  Table table = MakeTable(3);
  EXPECT_FALSE(Offer(Entry(0, nan), 1, &table).inserted);
  EXPECT_FALSE(Offer(Entry(1, -inf), 1, &table).inserted);
  EXPECT_FALSE(Offer(Entry(2, 1, nan), 1, &table).inserted);
  EXPECT_FALSE(Offer(Entry(3, 1, inf), 1, &table).inserted);
  EXPECT_EQ(table.scored, 4);
  EXPECT_TRUE(table.entries.empty());
}

TEST(Tables, StarvedMeansNotFullAfterTenTimesItsSizeWasScored) {
  Table table = MakeTable(2);
  for (int i = 0; i < 19; ++i) {
    Offer(Entry(i, 0, 0), 1, &table);
    EXPECT_FALSE(table.starved());
  }
  Offer(Entry(19, 0, 0), 1, &table);
  EXPECT_TRUE(table.starved());
  Offer(Entry(20, 0), 1, &table);
  EXPECT_TRUE(table.starved());
  Offer(Entry(21, 0), 1, &table);
  EXPECT_FALSE(table.starved());
  EXPECT_TRUE(table.full());
}

TEST(Tables, UnionNamesEverySegmentOnceInOrderOfArrival) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> entropy(-1, 1);
  std::vector<Table> tables(3, MakeTable(6));
  std::vector<bool> present(40, false);
  for (int i = 0; i < 40; ++i) {
    for (Table& table : tables) {
      Offer(Entry(i, entropy(random)), 1, &table);
    }
  }
  for (const Table& table : tables) {
    for (const TableEntry& entry : table.entries) {
      present[entry.sequence] = true;
    }
  }
  const std::vector<TableEntry> all = UnionOfTables(tables);
  EXPECT_EQ(static_cast<int>(all.size()),
            std::count(present.begin(), present.end(), true));
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_TRUE(present[all[i].sequence]);
    EXPECT_TRUE(i == 0 || all[i - 1].sequence < all[i].sequence);
  }
}

class TriggerTest : public ::testing::Test {
 protected:
  TriggerTest() {
    rig_.table_size = 4;
    rig_.retrigger_fraction = 0.5;
    rig_.groups = {{"a", {"imu.*"}}, {"b", {"cam0.*"}}};
    tables_ = MakeTables(rig_);
  }

  // Puts the segments [begin, end) into a table; each better than all before.
  void Fill(int table, int begin, int end) {
    for (int i = begin; i < end; ++i) {
      Offer(Entry(i, -i), rig_.min_gain_nats, &tables_[table]);
    }
  }
  void Starve(int table) {
    for (int i = 1000; i < 1040; ++i) {
      Offer(Entry(i, 0, 0), rig_.min_gain_nats, &tables_[table]);
    }
  }
  Trigger Evaluate(const std::optional<std::vector<SegmentKey>>& last = {}) {
    return EvaluateTrigger(rig_, tables_, last);
  }
  std::vector<SegmentKey> Keys() const {
    std::vector<SegmentKey> keys;
    for (const TableEntry& entry : UnionOfTables(tables_)) {
      keys.push_back(entry.key);
    }
    return keys;
  }

  Rig rig_;
  std::vector<Table> tables_;
};

TEST_F(TriggerTest, NothingStartsWhileATableStillFills) {
  EXPECT_EQ(Evaluate(), Trigger::kNone);
  Fill(0, 0, 4);
  Fill(1, 0, 3);
  EXPECT_EQ(Evaluate(), Trigger::kNone);
  Fill(1, 3, 4);
  EXPECT_EQ(Evaluate(), Trigger::kTablesFull);
}

TEST_F(TriggerTest, AStarvedTableDoesNotBlockAFullOne) {
  Fill(0, 0, 4);
  Starve(1);
  EXPECT_EQ(Evaluate(), Trigger::kTablesFull);
}

TEST_F(TriggerTest, StarvedTablesAloneStartNothing) {
  Starve(0);
  Starve(1);
  EXPECT_EQ(Evaluate(), Trigger::kNone);
}

TEST_F(TriggerTest, NextRunWaitsUntilEnoughEntriesAreNew) {
  Fill(0, 0, 4);
  Fill(1, 0, 4);
  const std::vector<SegmentKey> last = Keys();
  EXPECT_EQ(Evaluate(last), Trigger::kNone);
  Fill(0, 10, 13);  // 3 of 8 entries are new
  EXPECT_EQ(Evaluate(last), Trigger::kNone);
  Fill(1, 10, 11);  // 4 of 8
  EXPECT_EQ(Evaluate(last), Trigger::kTablesChanged);
}

TEST_F(TriggerTest, NoChangeStartsNothingEvenWithFractionZero) {
  rig_.retrigger_fraction = 0;
  Fill(0, 0, 4);
  Fill(1, 0, 4);
  const std::vector<SegmentKey> last = Keys();
  EXPECT_EQ(Evaluate(last), Trigger::kNone);
  Fill(0, 10, 11);
  EXPECT_EQ(Evaluate(last), Trigger::kTablesChanged);
}

TEST_F(TriggerTest, AManualRunDoesNotMakeUnfilledTablesReady) {
  Fill(0, 0, 2);
  const std::vector<SegmentKey> last = Keys();
  Fill(0, 2, 4);
  Fill(1, 0, 3);
  EXPECT_EQ(Evaluate(last), Trigger::kNone);
  Fill(1, 3, 4);
  EXPECT_EQ(Evaluate(last), Trigger::kTablesChanged);
}

}  // namespace
}  // namespace selfcal
