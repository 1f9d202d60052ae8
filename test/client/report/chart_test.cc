#include "client/report/chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace selfcal::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(PointChart, PutsTheEndsOfTheRangeAtTheEndsOfTheAxes) {
  const std::string chart = PointChart(
      {{1, -2, 0, true, "low"}, {3, 6, 0, false, "high"}}, "n", "x", "y");
  EXPECT_THAT(chart,
              HasSubstr("class=\"mark\" cx=\"60.0\" cy=\"140.0\" r=\"3\">"
                        "<title>low<"));
  EXPECT_THAT(chart,
              HasSubstr("class=\"hollow\" cx=\"680.0\" cy=\"24.0\" r=\"3\">"
                        "<title>high<"));
  EXPECT_THAT(chart, HasSubstr(">-2</text>"));
  EXPECT_THAT(chart, HasSubstr(">6</text>"));
}

TEST(PointChart, LeavesOutWhatIsNotANumber) {
  const std::string chart = PointChart({{1, kNan, 0, false, "nan"},
                                        {kInfinity, 2, 0, false, "infinite"},
                                        {2, 5, kNan, false, "five"}},
                                       "n",
                                       "x",
                                       "y");
  EXPECT_THAT(chart, Not(HasSubstr("nan")));
  EXPECT_THAT(chart, Not(HasSubstr("inf")));
  EXPECT_THAT(chart, HasSubstr("cx=\"370.0\""));  // one value: in the middle
  EXPECT_EQ(PointChart({{1, kNan, 0, false, ""}}, "n", "x", "y"), "");
  EXPECT_EQ(PointChart({}, "n", "x", "y"), "");
}

TEST(Sparkline, HasABandOfOneSigma) {
  const std::string line =
      Sparkline({{1, 0, 1, false, ""}, {2, 0, 3, false, ""}}, "course");
  EXPECT_THAT(line, HasSubstr("aria-label=\"course\""));
  // From +3 at the top (3) to -3 at the bottom (25); 0 is in the middle.
  EXPECT_THAT(line,
              HasSubstr("d=\"M2.0 10.3L118.0 3.0L118.0 25.0L2.0 17.7Z\""));
  EXPECT_THAT(line, HasSubstr("d=\"M2.0 14.0L118.0 14.0\""));
}

TEST(Bar, StaysInItsBox) {
  EXPECT_THAT(Bar(0.5, "n"), HasSubstr("width=\"59.0\""));
  EXPECT_THAT(Bar(7, "n"), HasSubstr("width=\"118.0\""));
  EXPECT_THAT(Bar(-1, "n"), HasSubstr("width=\"0.0\""));
  EXPECT_THAT(Bar(kNan, "n"), HasSubstr("width=\"0.0\""));
}

}  // namespace
}  // namespace selfcal::client
