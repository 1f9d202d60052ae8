#include "core/selection/baselines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/simulation/simulate.h"
#include "test/core/selection/random_candidates.h"

namespace selfcal {
namespace {

class BaselinesTest : public ::testing::Test {
 protected:
  BaselinesTest() : rig_(HandheldRig("handheld")) {
    rig_.table_size = 3;
    std::mt19937 random(1);
    const Eigen::VectorXd unit = PriorSigmas(rig_).cwiseInverse();
    const int size = static_cast<int>(unit.size());
    for (int i = 0; i < kCount; ++i) {
      const Eigen::MatrixXd information =
          RandomInformation(size, size, 1 + random() % 5, &random);
      informations_.push_back({});
      informations_.back().Lambda =
          unit.asDiagonal() * information * unit.asDiagonal();
    }
    for (int i = 0; i < kCount; ++i) {
      segments_.push_back({{"session", i}, i, &informations_[i]});
    }
  }

  // Entropies of group q, ascending.
  std::vector<double> Entropies(const Rig& rig, int q) const {
    std::vector<double> entropies;
    for (const SegmentInformation& information : informations_) {
      entropies.push_back(ScoreGroups(rig, information.Lambda)[q].entropy);
    }
    std::sort(entropies.begin(), entropies.end());
    return entropies;
  }

  static constexpr int kCount = 12;
  Rig rig_;
  std::vector<SegmentInformation> informations_;
  std::vector<ScoredSegment> segments_;
};

TEST_F(BaselinesTest, MostAndLeastInformativeAreTheTwoEndsOfEachTable) {
  const auto most = MostInformativeTables(rig_, segments_);
  const auto least = LeastInformativeTables(rig_, segments_);
  ASSERT_EQ(most.size(), rig_.groups.size());
  ASSERT_EQ(least.size(), rig_.groups.size());
  for (int q = 0; q < 3; ++q) {
    const std::vector<double> entropies = Entropies(rig_, q);
    ASSERT_EQ(most[q].entries.size(), 3u);
    ASSERT_EQ(least[q].entries.size(), 3u);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(most[q].entries[i].entropy, entropies[i]);
      EXPECT_EQ(least[q].entries[i].entropy, -entropies[kCount - 1 - i]);
    }
  }
}

TEST_F(BaselinesTest, SingleGroupIsOneTableForAllOfTheta) {
  const Table table = SingleGroupTable(rig_, 5, segments_);
  Rig single = rig_;
  single.groups = {{"all", {"*"}}};
  const std::vector<double> entropies = Entropies(single, 0);
  ASSERT_EQ(table.entries.size(), 5u);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(table.entries[i].entropy, entropies[i]);
  }
}

TEST_F(BaselinesTest, RandomSelectsEverySegmentEquallyOften) {
  constexpr int kDraws = 2000, kKept = 4;
  std::map<std::int64_t, int> times;
  std::map<std::pair<std::int64_t, std::int64_t>, int> pairs;
  for (int seed = 0; seed < kDraws; ++seed) {
    const Table table = RandomTable(rig_, kKept, seed, segments_);
    ASSERT_EQ(table.entries.size(), static_cast<std::size_t>(kKept));
    for (const TableEntry& a : table.entries) {
      ++times[a.sequence];
      for (const TableEntry& b : table.entries) {
        if (a.sequence < b.sequence) ++pairs[{a.sequence, b.sequence}];
      }
    }
  }
  // Five standard deviations of a binomial variable.
  const auto expect_part = [](int count, double part) {
    EXPECT_NEAR(
        count, kDraws * part, 5 * std::sqrt(kDraws * part * (1 - part)));
  };
  for (int i = 0; i < kCount; ++i) {
    expect_part(times[i], 1.0 * kKept / kCount);
    for (int j = i + 1; j < kCount; ++j) {
      expect_part(pairs[{i, j}],
                  1.0 * kKept * (kKept - 1) / (kCount * (kCount - 1)));
    }
  }
}

TEST_F(BaselinesTest, RandomIsAFunctionOfSeedAndSegments) {
  const Table table = RandomTable(rig_, 4, 7, segments_);
  EXPECT_EQ(RandomTable(rig_, 4, 7, segments_).entries, table.entries);
  std::vector<ScoredSegment> other_order(segments_.rbegin(), segments_.rend());
  other_order.insert(other_order.end(), segments_.begin(), segments_.end());
  EXPECT_EQ(RandomTable(rig_, 4, 7, other_order).entries, table.entries);
}

TEST_F(BaselinesTest, AllKeepTheMinimumGain) {
  informations_[3].Lambda.setZero();
  for (const Table& table : {LeastInformativeTables(rig_, segments_)[0],
                             SingleGroupTable(rig_, kCount, segments_),
                             RandomTable(rig_, kCount, 1, segments_)}) {
    EXPECT_FALSE(table.entries.empty());
    for (const TableEntry& entry : table.entries) {
      EXPECT_NE(entry.sequence, 3);
    }
  }
}

}  // namespace
}  // namespace selfcal
