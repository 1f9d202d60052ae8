#include "server/access/grants.h"

#include <gtest/gtest.h>

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
