#include "client/recording/order_of_time.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <set>
#include <string>
#include <vector>

namespace selfcal::client {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(OrderOfTime, OfSortedEntriesIsTheirs) {
  std::vector<std::string> problems;
  EXPECT_THAT(OrderOfTime({-3, 5, 8}, "walk", "images", &problems),
              ElementsAre(0, 1, 2));
  EXPECT_THAT(OrderOfTime({}, "walk", "images", &problems), IsEmpty());
  EXPECT_THAT(problems, IsEmpty());
}

TEST(OrderOfTime, KeepsTheFirstEntryOfATime) {
  std::vector<std::string> problems;
  EXPECT_THAT(OrderOfTime({7, 5, 7, 5, 9}, "walk", "images", &problems),
              ElementsAre(1, 0, 4));
  EXPECT_THAT(problems,
              ElementsAre("walk: 2 of 5 images are earlier than one before "
                          "them: sorted by time",
                          "walk: 2 of 5 images have the timestamp of another "
                          "one: left out"));
}

TEST(OrderOfTime, IsThatOfASetForRandomTimes) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<ImuSample> imu(random() % 30);
    std::set<std::int64_t> times_ns;
    for (ImuSample& sample : imu) {
      sample.t_ns = random() % 40;
      sample.gyro.x() = static_cast<double>(sample.t_ns);
      times_ns.insert(sample.t_ns);
    }
    std::vector<std::string> problems;
    SortByTime("walk", &imu, &problems);
    ASSERT_EQ(imu.size(), times_ns.size());
    std::size_t i = 0;
    for (const std::int64_t t_ns : times_ns) {
      EXPECT_EQ(imu[i].t_ns, t_ns);
      EXPECT_EQ(imu[i++].gyro.x(), static_cast<double>(t_ns));
    }
  }
}

}  // namespace
}  // namespace selfcal::client
