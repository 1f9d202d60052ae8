#include "client/cli/table.h"

#include <gtest/gtest.h>

namespace selfcal::client {
namespace {

TEST(Table, AlignsColumnsUnderTheirHeaders) {
  Table table({{"name"}, {"value", true}, {"unit"}});
  table.Add({"cam0.focal.x", "255.1", "px"});
  table.Add({"w", "-0.9", "-"});
  EXPECT_EQ(table.Aligned(),
            "name          value  unit\n"
            "cam0.focal.x  255.1  px\n"
            "w              -0.9  -\n");
}

TEST(Table, PrintsOneRecordALineIntoAPipe) {
  Table table({{"name"}, {"value", true}});
  table.Add({"a", "1"});
  table.Add({"b", ""});
  EXPECT_EQ(table.Tabbed(), "a\t1\nb\t\n");
}

TEST(Table, KeepsARecordOnOneLineWhateverItsCellsHold) {
  Table table({{"name"}, {"value"}});
  table.Add({"a\tb", "c\nd\re"});
  EXPECT_EQ(table.Tabbed(), "a b\tc d e\n");
}

TEST(Table, CountsCharactersNotBytes) {
  Table table({{"name"}, {"x"}});
  table.Add({"\xc3\xa4\xc3\xb6", "1"});
  table.Add({"abc", "2"});
  EXPECT_EQ(table.Aligned(),
            "name  x\n"
            "\xc3\xa4\xc3\xb6    1\n"
            "abc   2\n");
}

TEST(Table, TakesRowsOfAnyLength) {
  Table table({{"a"}, {"b"}});
  table.Add({"1"});
  table.Add({"1", "2", "3"});
  EXPECT_EQ(table.Tabbed(), "1\t\n1\t2\n");
}

TEST(Table, WithoutRowsIsItsHeaders) {
  Table table({{"a"}, {"b"}});
  EXPECT_EQ(table.Aligned(), "a  b\n");
  EXPECT_EQ(table.Tabbed(), "");
}

TEST(Facts, AlignTheirValues) {
  Facts facts;
  facts.Add("version", "2");
  facts.Add("state", "active");
  EXPECT_EQ(facts.Aligned(), "version  2\nstate    active\n");
  EXPECT_EQ(facts.Tabbed(), "version\t2\nstate\tactive\n");
}

}  // namespace
}  // namespace selfcal::client
