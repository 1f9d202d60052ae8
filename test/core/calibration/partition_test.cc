#include "core/calibration/partition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>

#include "test/core/calibration/hand_made_segments.h"

namespace selfcal {
namespace {

using Sets = std::vector<std::vector<int>>;

Partitioning Partition(const std::vector<MotionSegment>& segments,
                       int merge_landmarks = 15) {
  return PartitionSegments(SortByKey(segments), merge_landmarks);
}

// Keyframes at begin, begin + 0.1 .. begin + 0.3; the next begins at + 0.4.
MotionSegment Neighbour(int index, const std::vector<std::uint64_t>& ids = {}) {
  const double begin_s = 0.4 * index;
  return HandMadeSegment("a", index, begin_s, begin_s + 0.4, ids);
}

TEST(Partition, DirectNeighboursAreJoined) {
  const Partitioning result = Partition({Neighbour(0), Neighbour(1)});
  EXPECT_EQ(result.partitions, (Sets{{0, 1}}));
  EXPECT_EQ(result.joints, (std::vector<SegmentJoint>{{0, 1}}));
  EXPECT_TRUE(result.gaps.empty());
}

// Joined segments share one theta.
TEST(Partition, SegmentsOfADeviceThatWarmsUpAreNotJoinedForLong) {
  std::vector<MotionSegment> segments;
  for (int i = 0; i < 6; ++i) {
    segments.push_back(Neighbour(i));
    segments.back().temperature_c = 20 + 0.4 * i;
  }
  const Partitioning one = Partition(segments);
  EXPECT_EQ(one.partitions, (Sets{{0, 1, 2, 3, 4, 5}}));
  const Partitioning several = PartitionSegments(SortByKey(segments), 15, 1);
  EXPECT_EQ(several.partitions, (Sets{{0, 1, 2}, {3, 4, 5}}));
  EXPECT_EQ(several.joints,
            (std::vector<SegmentJoint>{{0, 1}, {1, 2}, {3, 4}, {4, 5}}));
  ASSERT_EQ(several.gaps.size(), 1u);
  EXPECT_EQ(several.gaps[0].before, 2);
  EXPECT_EQ(several.gaps[0].after, 3);
  EXPECT_NEAR(several.gaps[0].dt_s, 0.1, 1e-12);
}

TEST(Partition, SamplesThatEndBeforeTheNextKeyframeLeaveAGap) {
  const MotionSegment cut = HandMadeSegment("a", 0, 0, 0.38, {});
  const Partitioning result = Partition({cut, Neighbour(1)});
  EXPECT_EQ(result.partitions, (Sets{{0}, {1}}));
  EXPECT_TRUE(result.joints.empty());
  ASSERT_EQ(result.gaps.size(), 1u);
  EXPECT_NEAR(result.gaps[0].dt_s, 0.1, 1e-12);
}

TEST(Partition, MissingSegmentsLeaveAGapOfTheirLength) {
  const Partitioning result =
      Partition({Neighbour(0), Neighbour(3), Neighbour(4), Neighbour(9)});
  EXPECT_EQ(result.partitions, (Sets{{0}, {1, 2}, {3}}));
  EXPECT_EQ(result.joints, (std::vector<SegmentJoint>{{1, 2}}));
  ASSERT_EQ(result.gaps.size(), 2u);
  EXPECT_EQ(result.gaps[0].before, 0);
  EXPECT_EQ(result.gaps[0].after, 1);
  EXPECT_NEAR(result.gaps[0].dt_s, 1.2 - 0.3, 1e-12);
  EXPECT_EQ(result.gaps[1].before, 2);
  EXPECT_EQ(result.gaps[1].after, 3);
  EXPECT_NEAR(result.gaps[1].dt_s, 3.6 - 1.9, 1e-12);
}

TEST(Partition, ConsecutiveIndicesThatOverlapInTimeAreNeitherJoinedNorGap) {
  const Partitioning result =
      Partition({HandMadeSegment("a", 0, 0, 0.4, {}),
                 HandMadeSegment("a", 1, 0.3, 0.7, {})});
  EXPECT_EQ(result.partitions, (Sets{{0}, {1}}));
  EXPECT_TRUE(result.joints.empty());
  EXPECT_TRUE(result.gaps.empty());
}

TEST(Partition, SessionsShareNothingWhateverTheirIds) {
  const Partitioning result =
      Partition({HandMadeSegment("a", 0, 0, 0.4, IdRange(0, 100)),
                 HandMadeSegment("b", 1, 0.4, 0.8, IdRange(0, 100))});
  EXPECT_EQ(result.partitions, (Sets{{0}, {1}}));
  EXPECT_TRUE(result.joints.empty());
  EXPECT_TRUE(result.gaps.empty());
}

TEST(Partition, MergesOverTheThresholdAndNotAtIt) {
  const MotionSegment first = Neighbour(0, IdRange(0, 50));
  EXPECT_EQ(Partition({first, Neighbour(5, IdRange(35, 80))}).partitions,
            (Sets{{0}, {1}}));
  EXPECT_EQ(Partition({first, Neighbour(5, IdRange(34, 80))}).partitions,
            (Sets{{0, 1}}));
}

TEST(Partition, MergedSegmentsKeepTheirGap) {
  const Partitioning result =
      Partition({Neighbour(0, IdRange(0, 50)), Neighbour(5, IdRange(0, 50))});
  EXPECT_EQ(result.partitions, (Sets{{0, 1}}));
  EXPECT_TRUE(result.joints.empty());
  EXPECT_EQ(result.gaps.size(), 1u);
}

TEST(Partition, LandmarksWithoutAnObservationDoNotCount) {
  MotionSegment second = Neighbour(5, IdRange(0, 50));
  second.observations.resize(15);
  EXPECT_EQ(Partition({Neighbour(0, IdRange(0, 50)), second}).partitions,
            (Sets{{0}, {1}}));
}

TEST(Partition, CountsLandmarksOfAWholePartition) {
  // The last shares 10 with each of the others, which are joined: 20 together.
  std::vector<std::uint64_t> both = IdRange(0, 10);
  const std::vector<std::uint64_t> more = IdRange(100, 110);
  both.insert(both.end(), more.begin(), more.end());
  const std::vector<MotionSegment> segments = {Neighbour(0, IdRange(0, 50)),
                                               Neighbour(1, IdRange(100, 150)),
                                               Neighbour(8, both)};
  EXPECT_EQ(Partition(segments).partitions, (Sets{{0, 1, 2}}));
}

TEST(Partition, AMergeThatMakesAnotherPossibleIsFollowedUp) {
  // 0 and 1 have nothing in common with each other and 10 ids with 2 each; 3
  // merges 0 and 1, and only then 2 has 20 in common with them.
  std::vector<std::uint64_t> ten_of_both = IdRange(0, 10);
  const std::vector<std::uint64_t> other = IdRange(100, 110);
  ten_of_both.insert(ten_of_both.end(), other.begin(), other.end());
  std::vector<std::uint64_t> bridge = IdRange(20, 40);
  const std::vector<std::uint64_t> far = IdRange(120, 140);
  bridge.insert(bridge.end(), far.begin(), far.end());
  const std::vector<MotionSegment> segments = {Neighbour(0, IdRange(0, 50)),
                                               Neighbour(2, IdRange(100, 150)),
                                               Neighbour(4, ten_of_both),
                                               Neighbour(6, bridge)};
  EXPECT_EQ(Partition(segments).partitions, (Sets{{0, 1, 2, 3}}));
}

// Alg. 2 until nothing changes, on sets, without optimisation.
Sets BruteForce(const std::vector<const MotionSegment*>& segments,
                const std::vector<SegmentJoint>& joints,
                int merge_landmarks) {
  std::vector<int> label(segments.size());
  std::iota(label.begin(), label.end(), 0);
  const auto relabel = [&](int from, int to) {
    std::replace(label.begin(), label.end(), from, to);
  };
  for (const SegmentJoint& joint : joints) {
    relabel(label[joint.after], label[joint.before]);
  }
  const auto seen_by = [&](int l) {
    std::set<std::uint64_t> ids;
    for (std::size_t s = 0; s < segments.size(); ++s) {
      for (const Observation& o : segments[s]->observations) {
        if (label[s] == l) {
          ids.insert(segments[s]->landmarks[o.landmark].id);
        }
      }
    }
    return ids;
  };
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t i = 0; i < segments.size(); ++i) {
      for (std::size_t j = 0; j < segments.size(); ++j) {
        if (label[i] == label[j] ||
            segments[i]->key.session != segments[j]->key.session) {
          continue;
        }
        const std::set<std::uint64_t> a = seen_by(label[i]);
        int common = 0;
        for (const std::uint64_t id : seen_by(label[j])) {
          common += a.contains(id) ? 1 : 0;
        }
        if (common > merge_landmarks) {
          relabel(label[j], label[i]);
          changed = true;
        }
      }
    }
  }
  Sets sets;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    std::vector<int> members;
    for (std::size_t j = 0; j < segments.size(); ++j) {
      if (label[j] == label[i]) {
        members.push_back(static_cast<int>(j));
      }
    }
    if (members.front() == static_cast<int>(i)) {
      sets.push_back(members);
    }
  }
  return sets;
}

TEST(Partition, RandomSetsAgreeWithBruteForceInAnyOrder) {
  std::mt19937 random(3);
  int merged = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<MotionSegment> segments;
    for (int i = 0; i < 12; ++i) {
      if (random() % 3 == 0) {
        continue;
      }
      std::set<std::uint64_t> ids;
      const int count = 4 + static_cast<int>(random() % 10);
      while (static_cast<int>(ids.size()) < count) {
        ids.insert(random() % 60);
      }
      segments.push_back(Neighbour(i, {ids.begin(), ids.end()}));
      segments.back().key.session = i % 5 == 0 ? "b" : "a";
    }
    if (segments.empty()) {
      continue;
    }
    const Partitioning result = Partition(segments, 3);
    ASSERT_EQ(result.partitions,
              BruteForce(SortByKey(segments), result.joints, 3));
    merged += result.partitions.size() < segments.size() ? 1 : 0;

    std::shuffle(segments.begin(), segments.end(), random);
    const Partitioning shuffled = Partition(segments, 3);
    ASSERT_EQ(shuffled.partitions, result.partitions);
    ASSERT_EQ(shuffled.joints, result.joints);
    ASSERT_EQ(shuffled.gaps, result.gaps);
  }
  EXPECT_GT(merged, 100);
}

}  // namespace
}  // namespace selfcal
