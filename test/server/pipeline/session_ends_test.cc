#include "server/pipeline/session_ends.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace selfcal::server {
namespace {

using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

const SessionEnds::Clock::time_point kNow{seconds(1000)};

TEST(SessionEnds, AreDueWhenTheirTimeHasCome) {
  SessionEnds ends;
  ends.Add("a", kNow - seconds(1));
  ends.Add("b", kNow);
  ends.Add("c", kNow + seconds(1));
  EXPECT_THAT(ends.Due(kNow), ElementsAre("a", "b"));
  EXPECT_THAT(ends.Due(kNow + seconds(1)), ElementsAre("a", "b", "c"));
}

TEST(SessionEnds, AreForgottenWhenTheSessionGoesOn) {
  SessionEnds ends;
  ends.Add("a", kNow);
  EXPECT_TRUE(ends.Has("a"));
  ends.Remove("a");
  EXPECT_FALSE(ends.Has("a"));
  EXPECT_THAT(ends.Due(kNow), IsEmpty());
}

TEST(SessionEnds, ALaterEndReplacesAnEarlierOne) {
  SessionEnds ends;
  ends.Add("a", kNow);
  ends.Add("a", kNow + seconds(5));
  EXPECT_THAT(ends.Due(kNow), IsEmpty());
  EXPECT_EQ(ends.NextDue(kNow, kNow + seconds(30)), kNow + seconds(5));
}

// What is due already waits for something else, which wakes the thread.
TEST(SessionEnds, TheNextDueTimeIsInTheFuture) {
  SessionEnds ends;
  EXPECT_EQ(ends.NextDue(kNow, kNow + seconds(30)), kNow + seconds(30));
  ends.Add("a", kNow - seconds(1));
  ends.Add("b", kNow + seconds(40));
  EXPECT_EQ(ends.NextDue(kNow, kNow + seconds(30)), kNow + seconds(30));
  ends.Add("c", kNow + seconds(20));
  EXPECT_EQ(ends.NextDue(kNow, kNow + seconds(30)), kNow + seconds(20));
}

}  // namespace
}  // namespace selfcal::server
