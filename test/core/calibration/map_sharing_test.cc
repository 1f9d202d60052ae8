#include "core/calibration/map_sharing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <utility>

namespace selfcal {
namespace {

constexpr int kMerge = 15;

Track TrackOf(std::uint64_t id, const std::vector<int>& keyframes) {
  Track track{.id = id};
  for (const int k : keyframes) track.observations.push_back({.keyframe = k});
  return track;
}

std::vector<int> Range(int begin, int end) {
  std::vector<int> range;
  for (int k = begin; k < end; ++k) range.push_back(k);
  return range;
}

std::vector<int> Both(std::vector<int> a, const std::vector<int>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// Shares the map of all chains that begin at `starts`, with depth for all
// landmarks.
SharedMap Share(std::vector<Track> tracks,
                const SharingLimits& limits = {},
                const std::vector<int>& starts = {0},
                int merge_landmarks = kMerge) {
  const std::vector<bool> with_depth(tracks.size(), true);
  return ShareMap(limits,
                  merge_landmarks,
                  starts,
                  Range(0, static_cast<int>(starts.size())),
                  std::move(tracks),
                  with_depth);
}

TEST(MapSharing, ATrackWithoutHolesStaysWhole) {
  const SharedMap map = Share({TrackOf(3, Range(5, 85))});
  ASSERT_EQ(map.tracks.size(), 1u);
  EXPECT_EQ(map.tracks[0].id, 3u);
  EXPECT_EQ(map.tracks[0].observations.size(), 80u);
  EXPECT_TRUE(map.tracks[0].later_pieces.empty());
  EXPECT_EQ(map.connected, (std::vector<std::vector<int>>{{0}}));
}

TEST(MapSharing, APieceBeginsWhereALandmarkWasLostForLongerThanTheLimit) {
  const SharedMap map =
      Share({TrackOf(1, {0, 1, 11, 12}), TrackOf(2, {0, 1, 12, 13, 14, 25})});
  ASSERT_EQ(map.tracks.size(), 2u);
  EXPECT_TRUE(map.tracks[0].later_pieces.empty());
  EXPECT_EQ(map.tracks[1].later_pieces, (std::vector<int>{2, 5}));
}

TEST(MapSharing, APieceIsNoLongerThanTheLimit) {
  const SharedMap map = Share({TrackOf(1, Range(0, 200))});
  ASSERT_EQ(map.tracks.size(), 1u);
  EXPECT_EQ(map.tracks[0].later_pieces, (std::vector<int>{80, 160}));
}

TEST(MapSharing, APieceBeginsWhereAnotherChainBegins) {
  const SharedMap map =
      Share({TrackOf(1, {8, 9, 10, 11, 30})}, {}, {0, 10, 20}, 0);
  ASSERT_EQ(map.tracks.size(), 1u);
  EXPECT_EQ(map.tracks[0].later_pieces, (std::vector<int>{2, 4}));
}

TEST(MapSharing, ThoseWithTheMostPiecesStayConnected) {
  std::vector<Track> tracks;
  for (int id = 0; id < 40; ++id) {
    // Every fourth has three pieces.
    std::vector<int> seen = Both(Range(0, 5), Range(100, 105));
    if (id % 4 == 0) seen = Both(seen, Range(200, 205));
    tracks.push_back(TrackOf(id, seen));
  }
  const SharedMap map = Share(std::move(tracks), {.of_chain = 10});
  int connected = 0;
  for (const Track& track : map.tracks) {
    EXPECT_EQ(!track.later_pieces.empty(), track.id % 4 == 0);
    connected += track.later_pieces.empty() ? 0 : 1;
  }
  EXPECT_EQ(connected, 10);
  EXPECT_EQ(map.tracks.size(), 10u + 30u * 2u);
}

TEST(MapSharing, ChainsWithTooFewConnectionsShareNothing) {
  // Ten landmarks connect the third chain with the others, of which 40 connect
  // the first two.
  std::vector<Track> tracks;
  for (int id = 0; id < 40; ++id) {
    tracks.push_back(TrackOf(id, Both(Range(0, 5), Range(40, 45))));
  }
  for (int id = 40; id < 50; ++id) {
    tracks.push_back(TrackOf(id, Both(Range(40, 44), Range(80, 84))));
  }
  const SharedMap map = Share(std::move(tracks), {.of_chain = 30}, {0, 40, 80});
  EXPECT_EQ(map.connected, (std::vector<std::vector<int>>{{0, 1}, {2}}));
  int connected = 0;
  for (const Track& track : map.tracks) {
    if (track.later_pieces.empty()) continue;
    EXPECT_LT(track.id, 40u);
    ++connected;
  }
  EXPECT_EQ(connected, 30);
}

TEST(MapSharing, LandmarksWithoutDepthConnectNoChains) {
  const std::vector<int> starts = {0, 40};
  std::vector<Track> tracks;
  for (int id = 0; id < 20; ++id) {
    tracks.push_back(TrackOf(id, Both(Range(0, 5), Range(40, 45))));
  }
  std::vector<bool> with_depth(20, true);
  EXPECT_EQ(
      ShareMap({}, kMerge, starts, {0, 1}, tracks, with_depth).connected.size(),
      1u);
  std::fill_n(with_depth.begin(), 5, false);
  const SharedMap map =
      ShareMap({}, kMerge, starts, {0, 1}, tracks, with_depth);
  EXPECT_EQ(map.connected.size(), 2u);
  EXPECT_EQ(map.tracks.size(), 40u);
}

// For any observations: none is lost or counted twice, connections stay within
// the limits, and tracks within connected sets.
TEST(MapSharing, RandomMapsStayWithinTheLimits) {
  std::mt19937 random(5);
  int connected = 0, split = 0, apart = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const SharingLimits limits = {.max_lost = 3,
                                  .max_length = 12,
                                  .of_chain = static_cast<int>(random() % 9),
                                  .of_partition = 20};
    const std::vector<int> starts = {0, 13, 20, 60};
    const auto chain_of = [&](int keyframe) {
      return static_cast<int>(
          std::upper_bound(starts.begin(), starts.end(), keyframe) -
          starts.begin() - 1);
    };
    std::vector<Track> tracks;
    std::map<std::pair<std::uint64_t, int>, int> seen;
    for (int id = 0; id < 60; ++id) {
      std::set<int> keyframes;
      const int count = 1 + static_cast<int>(random() % 20);
      while (static_cast<int>(keyframes.size()) < count) {
        keyframes.insert(static_cast<int>(random() % 80));
      }
      tracks.push_back(TrackOf(id, {keyframes.begin(), keyframes.end()}));
      for (const int k : keyframes) ++seen[{id, k}];
    }
    const SharedMap map = Share(std::move(tracks), limits, starts, 2);
    std::map<int, int> set_of_chain;
    for (std::size_t s = 0; s < map.connected.size(); ++s) {
      for (const int chain : map.connected[s]) {
        EXPECT_TRUE(set_of_chain.emplace(chain, s).second);
      }
    }
    ASSERT_EQ(set_of_chain.size(), starts.size());
    apart += map.connected.size() > 1 ? 1 : 0;
    std::vector<int> of_chain(starts.size());
    std::set<std::uint64_t> in_all;
    for (const Track& track : map.tracks) {
      std::set<int> chains, sets;
      const auto& all = track.observations;
      auto later = track.later_pieces.begin();
      int piece_begin = all.front().keyframe;
      for (std::size_t i = 0; i < all.size(); ++i) {
        const int k = all[i].keyframe;
        --seen[{track.id, k}];
        chains.insert(chain_of(k));
        sets.insert(set_of_chain[chain_of(k)]);
        if (later != track.later_pieces.end() &&
            *later == static_cast<int>(i)) {
          piece_begin = k;
          ++later;
        } else if (i > 0) {
          EXPECT_LE(k - all[i - 1].keyframe, limits.max_lost);
          EXPECT_EQ(chain_of(k), chain_of(all[i - 1].keyframe));
        }
        EXPECT_LT(k - piece_begin, limits.max_length);
      }
      EXPECT_EQ(later, track.later_pieces.end());
      EXPECT_EQ(sets.size(), 1u);
      if (track.later_pieces.empty()) {
        ++split;
        continue;
      }
      ++connected;
      in_all.insert(track.id);
      for (const int chain : chains) ++of_chain[chain];
    }
    for (const int count : of_chain) EXPECT_LE(count, limits.of_chain);
    EXPECT_LE(static_cast<int>(in_all.size()), limits.of_partition);
    for (const auto& [observation, count] : seen) EXPECT_EQ(count, 0);
  }
  EXPECT_GT(connected, 100);
  EXPECT_GT(split, 100);
  EXPECT_GT(apart, 10);
}

}  // namespace
}  // namespace selfcal
