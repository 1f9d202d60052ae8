#include "core/selection/fit.h"

#include <gtest/gtest.h>

namespace selfcal {
namespace {

TEST(FitTest, IsComparedWithTheMedianOfTheNewest) {
  const auto largest = LargestFit({1.0, 1.2, 50, 1.4, 1.6}, {});
  ASSERT_TRUE(largest.has_value());
  EXPECT_DOUBLE_EQ(*largest, 3 * 1.4);
}

TEST(FitTest, NoiseThatIsStatedWrongRaisesAllAlike) {
  const auto largest = LargestFit({10, 11, 9, 10.5, 9.5}, {10, 9, 11, 10});
  ASSERT_TRUE(largest.has_value());
  EXPECT_GT(*largest, 11);
  EXPECT_LT(*largest, 100);
}

TEST(FitTest, WhatLiesWithinTheStatedNoiseFits) {
  EXPECT_EQ(LargestFit({1e-6, 1e-6, 1e-6, 1e-6}, {}), 1.0);
}

TEST(FitTest, FewSegmentsAreNoComparison) {
  EXPECT_FALSE(LargestFit({}, {}).has_value());
  EXPECT_FALSE(LargestFit({1, 1, 1}, {1, 1, 1}).has_value());
}

TEST(FitTest, WhatWasNotMeasuredDoesNotCount) {
  EXPECT_FALSE(LargestFit({0, 0, 0, 0, 1, 1, 1}, {}).has_value());
  EXPECT_EQ(LargestFit({0, 0, 0, 2, 2, 2, 2}, {}), 6.0);
}

TEST(FitTest, ABadSessionAmongGoodOnesIsComparedWithWhatIsKept) {
  const std::vector<double> bad(16, 40.0);
  EXPECT_EQ(LargestFit(bad, {1, 1, 1, 1}), 3.0);
}

TEST(FitTest, GoodSegmentsAfterBadOnesMakeTheseMisfits) {
  const std::vector<double> newest = {1, 1, 1, 1, 1, 40, 40, 40, 40};
  EXPECT_EQ(LargestFit(newest, {40, 40, 40, 40, 40, 40, 40, 1}), 3.0);
}

}  // namespace
}  // namespace selfcal
