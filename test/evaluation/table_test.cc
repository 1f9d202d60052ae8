#include "test/evaluation/table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace selfcal {
namespace {

TEST(ResultTable, WritesNumbersForMachinesAndForReaders) {
  ResultTable table({"name", "n", "value"});
  table.Add({"a", 3L, 1.23456789012});
  table.Add({"b, c", 4L, {}});
  EXPECT_EQ(table.Csv(), "name,n,value\na,3,1.23456789\n\"b, c\",4,\n");
  EXPECT_EQ(table.Markdown(),
            "| name | n | value |\n| --- | --- | --- |\n"
            "| a | 3 | 1.235 |\n| b, c | 4 |  |\n");
}

TEST(ResultTable, EscapesWhatTheFormatsMean) {
  ResultTable table({"|x|"});
  table.Add({"say \"a\""});
  EXPECT_EQ(table.Csv(), "|x|\n\"say \"\"a\"\"\"\n");
  EXPECT_EQ(table.Markdown(), "| \\|x\\| |\n| --- |\n| say \"a\" |\n");
}

TEST(ResultTable, RefusesWhatIsNoResult) {
  ResultTable table({"a", "b"});
  EXPECT_THROW(table.Add({1.0}), std::invalid_argument);
  EXPECT_THROW(table.Add({1.0, std::nan("")}), std::invalid_argument);
  EXPECT_THROW(table.Add({1.0, INFINITY}), std::invalid_argument);
}

}  // namespace
}  // namespace selfcal
