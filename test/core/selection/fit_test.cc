#include "core/selection/fit.h"

#include <gtest/gtest.h>

namespace selfcal {
namespace {

TEST(FitTest, IsComparedWithTheMedianOfTheNewest) {
  const auto largest = LargestFit({1.0, 1.2, 50, 1.4, 1.6}, {});
  ASSERT_TRUE(largest.has_value());
  EXPECT_DOUBLE_EQ(*largest, 3 * 1.4);
}

TEST(FitTest, IsComparedWithHowMuchFitsDiffer) {
  // All equal, and then with more spread: a tenth of the median as the median
  // distance, 1.4826 times that as the standard deviation.
  EXPECT_DOUBLE_EQ(*LargestFit({1.99, 2, 2, 2.01, 2}, {}), 1.5 * 2);
  EXPECT_DOUBLE_EQ(*LargestFit({1.6, 1.8, 2, 2.2, 2.4}, {}), 2 + 10 * 0.29652);
  // One in five segments has timestamps with an error: simulated.
  EXPECT_LT(*LargestFit({1.01, 1.01, 1.91, 1.01, 0.99, 1.01, 1.0, 1.86}, {}),
            1.86);
  // One landmark in ten moves, and nothing is wrong: simulated.
  EXPECT_GT(*LargestFit({1.15,
                         1.14,
                         1.27,
                         1.2,
                         1.16,
                         1.23,
                         1.18,
                         1.17,
                         1.17,
                         1.15,
                         1.17,
                         1.36,
                         1.22,
                         1.16,
                         1.26},
                        {}),
            1.36);
}

TEST(FitTest, WronglyStatedNoiseRaisesAllAlike) {
  const auto largest = LargestFit({10, 11, 9, 10.5, 9.5}, {10, 9, 11, 10});
  ASSERT_TRUE(largest.has_value());
  EXPECT_GT(*largest, 11);
  EXPECT_LT(*largest, 100);
}

TEST(FitTest, AFitWithinTheStatedNoiseIsAccepted) {
  EXPECT_EQ(LargestFit({1e-6, 1e-6, 1e-6, 1e-6}, {}), 1.0);
}

TEST(FitTest, FewSegmentsAreNoComparison) {
  EXPECT_FALSE(LargestFit({}, {}).has_value());
  EXPECT_FALSE(LargestFit({1, 1, 1}, {1, 1, 1}).has_value());
}

TEST(FitTest, UnmeasuredFitsAreIgnored) {
  EXPECT_FALSE(LargestFit({0, 0, 0, 0, 1, 1, 1}, {}).has_value());
  EXPECT_EQ(LargestFit({0, 0, 0, 2, 2, 2, 2}, {}), 3.0);
}

TEST(FitTest, ABadSessionAmongGoodOnesIsComparedWithKeptSegments) {
  const std::vector<double> bad(16, 40.0);
  EXPECT_EQ(LargestFit(bad, {1, 1, 1, 1}), 1.5);
}

TEST(FitTest, GoodSegmentsAfterBadOnesMakeTheseMisfits) {
  const std::vector<double> newest = {1, 1, 1, 1, 1, 40, 40, 40, 40};
  EXPECT_EQ(LargestFit(newest, {40, 40, 40, 40, 40, 40, 40, 1}), 1.5);
}

}  // namespace
}  // namespace selfcal
