#include "client/selfcal/backoff.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace selfcal::client {
namespace {

using std::chrono::milliseconds;

TEST(Backoff, DoublesUpToItsLimitWithJitter) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Backoff backoff(milliseconds(100), milliseconds(5000), seed);
    std::int64_t step = 100;
    for (int i = 0; i < 20; ++i) {
      const std::int64_t wait = backoff.Next().count();
      EXPECT_GE(wait, step / 2);
      EXPECT_LE(wait, step);
      step = std::min<std::int64_t>(2 * step, 5000);
    }
    backoff.Reset();
    EXPECT_LE(backoff.Next().count(), 100);
  }
}

TEST(Backoff, DiffersBetweenSeeds) {
  std::set<std::int64_t> waits;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Backoff backoff(milliseconds(5000), milliseconds(5000), seed);
    waits.insert(backoff.Next().count());
  }
  EXPECT_GT(waits.size(), 50u);
}

TEST(Backoff, MakesSenseOfAnyOptions) {
  Backoff nothing(milliseconds(0), milliseconds(-1), 0);
  EXPECT_EQ(nothing.Next(), milliseconds(1));
  Backoff longest(milliseconds::max(), milliseconds::max(), 0);
  EXPECT_GT(longest.Next().count(), 0);
  EXPECT_GT(longest.Next().count(), 0);
}

}  // namespace
}  // namespace selfcal::client
