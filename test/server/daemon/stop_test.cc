#include "server/daemon/stop.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <cstdlib>
#include <thread>

namespace selfcal::server {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

TEST(StopDeathTest, DeadlineEndsAStopThatHangs) {
  EXPECT_EXIT(
      {
        const StopDeadline deadline(milliseconds(20));
        std::this_thread::sleep_for(hours(1));
      },
      ::testing::ExitedWithCode(EXIT_FAILURE),
      "");
}

TEST(StopDeathTest, DeadlineOfAStopInTimeDoesNotEndTheProcess) {
  EXPECT_EXIT(
      {
        { const StopDeadline deadline(milliseconds(20)); }
        std::this_thread::sleep_for(milliseconds(200));
        std::_Exit(3);
      },
      ::testing::ExitedWithCode(3),
      "");
}

TEST(StopDeathTest, BlockedSignalIsReceivedInsteadOfEndingTheProcess) {
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) {
    EXPECT_EXIT(
        {
          BlockSignals();
          raise(signal);
          std::_Exit(WaitForSignal(hours(1)) == signal ? 3 : 4);
        },
        ::testing::ExitedWithCode(3),
        "");
  }
}

TEST(Stop, WaitingForASignalEndsAfterItsLimit) {
  BlockSignals();
  EXPECT_EQ(WaitForSignal(milliseconds(5)), std::nullopt);
}

}  // namespace
}  // namespace selfcal::server
