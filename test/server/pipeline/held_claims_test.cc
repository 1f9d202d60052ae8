#include "server/pipeline/held_claims.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace selfcal::server {
namespace {

using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

HeldClaims::Clock::time_point At(int time_s) {
  return HeldClaims::Clock::time_point(seconds(time_s));
}

TEST(HeldClaimsTest, FindsTheNewestClaimOfARigUntilItIsRemoved) {
  HeldClaims claims;
  claims.Reset("one");
  EXPECT_EQ(claims.replica(), "one");
  EXPECT_EQ(claims.Find("a"), std::nullopt);
  claims.Add({"a", 4, 1}, At(0));
  claims.Add({"b", 5, 3}, At(0));
  claims.Add({"a", 4, 2}, At(1));
  EXPECT_EQ(claims.Find("a"), RigClaim("a", 4, 2));
  claims.Remove("a");
  EXPECT_EQ(claims.Find("a"), std::nullopt);
  EXPECT_EQ(claims.Find("b"), RigClaim("b", 5, 3));
}

TEST(HeldClaimsTest, ANewReplicaHoldsNone) {
  HeldClaims claims;
  claims.Reset("one");
  claims.Add({"a", 4, 1}, At(0));
  claims.Reset("two");
  EXPECT_EQ(claims.replica(), "two");
  EXPECT_EQ(claims.Find("a"), std::nullopt);
  EXPECT_THAT(claims.NoteBusy({}, At(1000)), IsEmpty());
}

TEST(HeldClaimsTest, OneIsIdleWhoseRigHasHadNoWorkForAWhile) {
  constexpr int kKeep_s = HeldClaims::kKeep / seconds(1);
  HeldClaims claims;
  claims.Reset("one");
  claims.Add({"busy", 4, 1}, At(0));
  claims.Add({"idle", 5, 1}, At(0));
  EXPECT_THAT(claims.NoteBusy({"busy", "idle"}, At(100)), IsEmpty());
  EXPECT_THAT(claims.NoteBusy({"busy"}, At(100 + kKeep_s)), IsEmpty());
  EXPECT_THAT(claims.NoteBusy({"busy"}, At(101 + kKeep_s)),
              ElementsAre(RigClaim("idle", 5, 1)));
  EXPECT_EQ(claims.Find("idle"), RigClaim("idle", 5, 1)) << "still held";
  EXPECT_THAT(claims.NoteBusy({"busy", "idle"}, At(102 + kKeep_s)), IsEmpty());
}

}  // namespace
}  // namespace selfcal::server
