#include "server/daemon/stop.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <cstdlib>
#include <thread>

#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;

TEST(StopDeathTest, DeadlineEndsAStopThatHangs) {
  EXPECT_EXIT(
      {
        const StopDeadline deadline(milliseconds(20));
        std::this_thread::sleep_for(kLongWait);
        std::_Exit(3);
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
          std::_Exit(WaitForSignal(kLongWait) == signal ? 3 : 4);
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
