#include "server/api/traffic.h"

#include <gtest/gtest.h>

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class TrafficTest : public ::testing::Test {
 protected:
  MinuteRate::Time now_{seconds(1'000'000)};
  Traffic traffic_{[this] { return now_; }};
};

TEST_F(TrafficTest, CountsByRigAndTogether) {
  traffic_.Opened("a");
  traffic_.Opened("a");
  traffic_.Opened("b");
  traffic_.Closed("a");
  traffic_.Stored("a");
  traffic_.Stored("a");
  traffic_.Stored("b");
  traffic_.Rejected("b");
  EXPECT_EQ(traffic_.Of("a").streams, 1);
  EXPECT_EQ(traffic_.Of("a").stored, 2);
  EXPECT_EQ(traffic_.Of("a").rejected, 0);
  EXPECT_EQ(traffic_.Of("b").rejected, 1);
  EXPECT_EQ(traffic_.Of("nobody").streams, 0);
  EXPECT_EQ(traffic_.OfAll().streams, 2);
  EXPECT_EQ(traffic_.OfAll().stored, 3);
  EXPECT_EQ(traffic_.OfAll().rejected, 1);
}

TEST_F(TrafficTest, TheMeanRateOfASteadyStreamIsItsRate) {
  double sum = 0;
  int samples = 0;
  // A segment each 4 s; the rate is looked at each 0.1 s of the second half.
  for (int k = 0; k < 12'000; ++k) {
    if (k % 40 == 0) traffic_.Stored("a");
    if (k >= 6'000) {
      sum += traffic_.Of("a").stored_per_minute;
      ++samples;
    }
    now_ += milliseconds(100);
  }
  EXPECT_NEAR(sum / samples, 15, 0.1);
}

TEST_F(TrafficTest, TheRateOfWhoStoppedFalls) {
  for (int k = 0; k < 100; ++k) traffic_.Stored("a");
  EXPECT_DOUBLE_EQ(traffic_.Of("a").stored_per_minute, 100);
  now_ += seconds(60);
  EXPECT_NEAR(traffic_.Of("a").stored_per_minute, 36.8, 0.1);
  now_ += seconds(3600);
  EXPECT_NEAR(traffic_.OfAll().stored_per_minute, 0, 1e-6);
}

}  // namespace
}  // namespace selfcal::server
