#include "client/selfcal/keeper_step.h"

#include <gtest/gtest.h>

#include <vector>

namespace selfcal::client {
namespace {

// Every situation that can occur.
std::vector<KeeperSituation> AllSituations() {
  std::vector<KeeperSituation> all;
  for (unsigned bits = 0; bits < 1u << 8; ++bits) {
    const auto bit = [&](unsigned n) { return (bits >> n & 1) != 0; };
    KeeperSituation now;
    now.has_finished_files = bit(0);
    now.has_incoming = bit(1);
    now.has_encoded = bit(2);
    now.window_is_empty = bit(3);
    now.window_has_room = bit(4);
    now.has_unloaded = bit(5);
    now.spool_is_usable = bit(6);
    now.memory_has_room = bit(7);
    // The window has room for at least one segment.
    if (now.window_is_empty && !now.window_has_room) continue;
    // What fills the memory is in the window or new.
    if (now.window_is_empty && !now.has_incoming && !now.has_encoded &&
        !now.memory_has_room) {
      continue;
    }
    all.push_back(now);
  }
  return all;
}

TEST(KeeperStep, IsAlwaysPossible) {
  for (const KeeperSituation& now : AllSituations()) {
    switch (NextStep(now)) {
      case KeeperStep::kWait:
        break;
      case KeeperStep::kRemoveFiles:
        EXPECT_TRUE(now.has_finished_files);
        break;
      case KeeperStep::kEncode:
        EXPECT_TRUE(now.has_incoming);
        EXPECT_FALSE(now.has_encoded) << "the keeper holds at most one";
        break;
      case KeeperStep::kAppend:
        EXPECT_TRUE(now.has_encoded && now.window_has_room);
        break;
      case KeeperStep::kSpool:
        EXPECT_TRUE(now.has_encoded && now.spool_is_usable);
        break;
      case KeeperStep::kLoad:
        EXPECT_TRUE(now.has_unloaded && now.window_has_room);
        EXPECT_TRUE(now.memory_has_room);
        EXPECT_TRUE(now.spool_is_usable);
        break;
    }
  }
}

TEST(KeeperStep, NeverPassesAnOlderSegmentOnDisk) {
  for (const KeeperSituation& now : AllSituations()) {
    if (!now.has_unloaded) continue;
    EXPECT_NE(NextStep(now), KeeperStep::kAppend);
  }
}

TEST(KeeperStep, WaitsOnlyIfNothingIsPossible) {
  for (const KeeperSituation& now : AllSituations()) {
    if (NextStep(now) != KeeperStep::kWait) continue;
    EXPECT_FALSE(now.has_finished_files);
    const bool has_new = now.has_incoming || now.has_encoded;
    if (now.spool_is_usable) {
      EXPECT_FALSE(has_new) << "it could be encoded and go to disk";
      EXPECT_FALSE(now.has_unloaded && now.window_has_room &&
                   now.memory_has_room);
    } else if (has_new) {
      EXPECT_TRUE(now.has_unloaded || !now.window_has_room);
    }
  }
}

TEST(KeeperStep, WritesToDiskOnlyWhatTheWindowCannotTake) {
  for (const KeeperSituation& now : AllSituations()) {
    if (NextStep(now) != KeeperStep::kSpool) continue;
    EXPECT_TRUE(now.has_unloaded || !now.window_has_room);
  }
}

TEST(KeeperStep, TakesFromTheSlamSystemFirstUnlessTheSenderIsIdle) {
  KeeperSituation now;
  now.has_incoming = now.has_unloaded = now.spool_is_usable = true;
  now.window_is_empty = false;
  EXPECT_EQ(NextStep(now), KeeperStep::kEncode);
  now.window_is_empty = true;
  EXPECT_EQ(NextStep(now), KeeperStep::kLoad);
}

}  // namespace
}  // namespace selfcal::client
