#include "server/pipeline/periodic_thread.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>

#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kNever = std::chrono::hours(24);

TEST(PeriodicThreadTest, RepeatsThePassAfterItsPause) {
  std::atomic<int> passes{0};
  PeriodicThread thread(milliseconds(0));
  thread.Start([&] {
    ++passes;
    return milliseconds(1);
  });
  EXPECT_TRUE(Eventually([&] { return passes >= 3; }));
}

TEST(PeriodicThreadTest, WakingItEndsThePause) {
  std::atomic<int> passes{0};
  PeriodicThread thread(milliseconds(0));
  thread.Start([&] {
    ++passes;
    return kNever;
  });
  for (const int expected : {1, 2, 3}) {
    ASSERT_TRUE(Eventually([&] { return passes == expected; }));
    thread.Wake();
  }
}

TEST(PeriodicThreadTest, APassThatWakesItIsFollowedByAnother) {
  std::atomic<int> passes{0};
  PeriodicThread thread(milliseconds(0));
  thread.Start([&] {
    if (++passes == 1) thread.Wake();
    return kNever;
  });
  EXPECT_TRUE(Eventually([&] { return passes == 2; }));
}

TEST(PeriodicThreadTest, StopEndsEitherPauseAndItCanStartAgain) {
  std::atomic<int> passes{0};
  const auto pass = [&] {
    ++passes;
    return kNever;
  };
  for (const milliseconds min_pause : {milliseconds(0), kNever}) {
    passes = 0;
    PeriodicThread thread(min_pause);
    thread.Stop();  // has not been started
    for (const int expected : {1, 2}) {
      thread.Start(pass);
      ASSERT_TRUE(Eventually([&] { return passes == expected; }));
      thread.Stop();
    }
    EXPECT_EQ(passes, 2);
  }
}

}  // namespace
}  // namespace selfcal::server
