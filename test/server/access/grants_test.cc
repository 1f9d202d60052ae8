#include "server/access/grants.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace selfcal::server {
namespace {

TEST(Grants, RolesHaveNames) {
  for (const Role role : {Role::kRead, Role::kProduce, Role::kAdminister}) {
    EXPECT_EQ(ParseRole(RoleName(role)), role);
  }
  EXPECT_EQ(ParseRole("Administer"), std::nullopt);
  EXPECT_EQ(ParseRole(""), std::nullopt);
}

TEST(Grants, UriGrantsARoleOnAllRigsOrOnOne) {
  EXPECT_EQ(ParseGrant("selfcal://role/read"), (Grant{Role::kRead, ""}));
  EXPECT_EQ(ParseGrant("selfcal://role/produce/rigs/tablet-7"),
            (Grant{Role::kProduce, "tablet-7"}));
}

TEST(Grants, UriGrantsARoleOnTheRigsWithALabel) {
  EXPECT_EQ(ParseGrant("selfcal://role/read/labels/site/north"),
            (Grant{Role::kRead, "", Label("site", "north")}));
  EXPECT_EQ(ParseGrant("selfcal://role/administer/labels/site/a%20b%2Fc%2f%25"),
            (Grant{Role::kAdminister, "", Label("site", "a b/c/%")}));
  EXPECT_EQ(ParseGrant("selfcal://role/read/labels/spare/"),
            (Grant{Role::kRead, "", Label("spare", "")}));
  EXPECT_EQ(
      ParseGrant("selfcal://role/read/labels/site/" + std::string(64, 'a')),
      std::nullopt);
}

TEST(Grants, RightsAreThoseOfTheRole) {
  const Caller caller{"x",
                      {{Role::kRead, "", Label("site", "north")},
                       {Role::kProduce, "a"},
                       {Role::kAdminister, "b"}}};
  const auto rights = RightsOf(caller, Role::kProduce);
  ASSERT_TRUE(rights);
  EXPECT_EQ(rights->rigs, (std::set<std::string>{"a", "b"}));
  EXPECT_TRUE(rights->labels.empty());
  const auto read = RightsOf(caller, Role::kRead);
  ASSERT_TRUE(read);
  EXPECT_TRUE(Include(*read, "c", {{"model", "t4"}, {"site", "north"}}));
  EXPECT_TRUE(Include(*read, "a", {}));
  EXPECT_FALSE(Include(*read, "c", {{"model", "north"}, {"site", "south"}}));
  EXPECT_FALSE(RightsOf({"y", {{Role::kRead}}}, Role::kRead));
  EXPECT_TRUE(RightsOf({"z", {}}, Role::kRead)->empty());
}

TEST(Grants, AnythingElseGrantsNothing) {
  for (const char* uri : {"",
                          "selfcal://role/",
                          "selfcal://role/root",
                          "selfcal://role/read/",
                          "selfcal://role/read/rigs",
                          "selfcal://role/read/rigs/",
                          "selfcal://role/read/rigs/a/b",
                          "selfcal://role/read/rigs/*",
                          "selfcal://role/read/rigs/A",
                          "selfcal://role/read/segments/a",
                          "selfcal://role/read/labels",
                          "selfcal://role/read/labels/",
                          "selfcal://role/read/labels/site",
                          "selfcal://role/read/labels//north",
                          "selfcal://role/read/labels/Site/north",
                          "selfcal://role/read/labels/1/north",
                          "selfcal://role/read/labels/site/a/b",
                          "selfcal://role/read/labels/site/%",
                          "selfcal://role/read/labels/site/%2",
                          "selfcal://role/read/labels/site/%zz",
                          "selfcal://role/read/labels/site/%00",
                          "selfcal://role/read/labels/site/%0a",
                          "selfcal://role/read/labels/site/\xc3\xbc",
                          " selfcal://role/read",
                          "SELFCAL://role/read",
                          "https://role/read",
                          "spiffe://selfcal/role/read"}) {
    EXPECT_EQ(ParseGrant(uri), std::nullopt) << uri;
  }
  EXPECT_EQ(ParseGrant("selfcal://role/read/rigs/" + std::string(64, 'a')),
            std::nullopt);
}

}  // namespace
}  // namespace selfcal::server
