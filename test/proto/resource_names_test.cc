#include "proto/resource_names.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>

namespace selfcal {
namespace {

TEST(ResourceNames, RigNameRoundTrips) {
  for (const std::string rig : {"a", "rig_7-b", "0", "-"}) {
    EXPECT_EQ(ParseRigName(RigName(rig)), rig);
  }
  EXPECT_EQ(ParseRigName(RigName(std::string(63, 'z'))), std::string(63, 'z'));
}

TEST(ResourceNames, WhatIsNoRigIsRefused) {
  for (const std::string& name : {std::string(""),
                                  std::string("rigs"),
                                  std::string("rigs/"),
                                  std::string("rig/a"),
                                  std::string("rigs/A"),
                                  std::string("rigs/a/"),
                                  std::string("rigs/a b"),
                                  std::string("rigs/a/tables/b"),
                                  std::string("/rigs/a"),
                                  std::string("rigs/a\0b", 8),
                                  RigName(std::string(64, 'z'))}) {
    EXPECT_FALSE(ParseRigName(name)) << name;
  }
}

TEST(ResourceNames, SegmentNameReadsAsDocumented) {
  EXPECT_EQ(SegmentName("r", {"walk_1.bag", 12}),
            "rigs/r/segments/walk_1.bag~12");
  EXPECT_EQ(SegmentName("r", {"a/b c~1", 0}),
            "rigs/r/segments/a%2Fb%20c%7E1~0");
}

TEST(ResourceNames, SegmentNameRoundTripsForOddSessions) {
  std::mt19937_64 engine(1);
  std::uniform_int_distribution<int> byte(0, 255);
  std::uniform_int_distribution<std::int64_t> index(
      0, std::numeric_limits<std::int64_t>::max());
  std::vector<std::string> sessions = {
      "~", "%", "%41", "/", "../..", "a~3", "~~1", " ", "\xc3\xa9"};
  for (int i = 0; i < 2000; ++i) {
    std::string session;
    for (int k = byte(engine) % 30; k >= 0; --k) {
      session += static_cast<char>(byte(engine));
    }
    sessions.push_back(session);
  }
  for (const std::string& session : sessions) {
    const SegmentKey key{session, index(engine)};
    const auto parts = ParseSegmentName(SegmentName("r-1", key));
    ASSERT_TRUE(parts) << session;
    EXPECT_EQ(parts->rig, "r-1");
    EXPECT_EQ(parts->key, key);
  }
}

TEST(ResourceNames, DifferentSegmentsHaveDifferentNames) {
  std::set<std::string> names;
  for (const std::string session : {"a", "a~1", "a%7E1", "A", "a ", "a%20"}) {
    for (const std::int64_t index : {0, 1, 11}) {
      names.insert(SegmentName("r", {session, index}));
    }
  }
  EXPECT_EQ(names.size(), 18u);
}

TEST(ResourceNames, WhatIsNoSegmentIsRefused) {
  for (const std::string name :
       {"rigs/r/segments/",      "rigs/r/segments/a",
        "rigs/r/segments/~1",    "rigs/r/segments/a~",
        "rigs/r/segments/a~-1",  "rigs/r/segments/a~+1",
        "rigs/r/segments/a~01",  "rigs/r/segments/a~1x",
        "rigs/r/segments/a~1~2", "rigs/r/segments/a~9223372036854775808",
        "rigs/r/segments/a/b~1", "rigs/r/segments/a%2~1",
        "rigs/r/segments/a%~1",  "rigs/r/segments/a%2f~1",
        "rigs/r/segments/%41~1", "rigs/r/segments/a%zz~1",
        "rigs//segments/a~1",    "rigs/R/segments/a~1",
        "rigs/r/tables/a~1",     "segments/a~1"}) {
    EXPECT_FALSE(ParseSegmentName(name)) << name;
  }
}

TEST(ResourceNames, ChildNameRoundTrips) {
  EXPECT_EQ(ChildName("r", "tables", "imu"), "rigs/r/tables/imu");
  for (const std::string id : {"1", "active", "a/b", "%", "my group"}) {
    const auto parts = ParseChildName(ChildName("r", "tables", id), "tables");
    ASSERT_TRUE(parts) << id;
    EXPECT_EQ(parts->rig, "r");
    EXPECT_EQ(parts->id, id);
  }
}

TEST(ResourceNames, ChildOfAnotherCollectionIsRefused) {
  for (const std::string name : {"rigs/r/calibrations/1",
                                 "rigs/r/tables",
                                 "rigs/r/tables/",
                                 "rigs/r/tables/a/b",
                                 "rigs/r/tablesx/a",
                                 "rigs/r/"}) {
    EXPECT_FALSE(ParseChildName(name, "tables")) << name;
  }
}

}  // namespace
}  // namespace selfcal
