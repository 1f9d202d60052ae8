#include "server/encode/rig_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

std::string Refusal(const std::string& filter) {
  RigQuery query;
  return std::string(ParseRigFilter(filter, &query).message());
}

TEST(RigFilter, ReadsTextNameAndLabels) {
  RigQuery query;
  ASSERT_TRUE(
      ParseRigFilter("tab AND name = tablet-7 AND labels.site = lab", &query)
          .ok());
  EXPECT_EQ(query.text, "tab");
  EXPECT_EQ(query.name, "tablet-7");
  EXPECT_THAT(query.labels, ElementsAre(Pair("site", "lab")));
}

TEST(RigFilter, ATextAloneIsAPartOfTheName) {
  RigQuery query;
  ASSERT_TRUE(ParseRigFilter("name", &query).ok());
  EXPECT_EQ(query.text, "name");
  EXPECT_EQ(query.name, "");
}

TEST(RigFilter, SaysWhichConditionsThereAre) {
  for (const char* filter :
       {"rig = a", "name > a", "name.x = a", "labels = a"}) {
    EXPECT_THAT(Refusal(filter),
                HasSubstr("name = RIG, labels.NAME = VALUE, or a text alone"))
        << filter;
  }
  EXPECT_THAT(Refusal("name = a AND name = b"), HasSubstr("give one name"));
  EXPECT_THAT(Refusal("name = \"\""), HasSubstr("give one name"));
  EXPECT_THAT(Refusal("a AND b"), HasSubstr("give one text"));
}

}  // namespace
}  // namespace selfcal::server
