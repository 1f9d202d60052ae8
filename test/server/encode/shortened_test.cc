#include "server/encode/shortened.h"

#include <gtest/gtest.h>

#include <random>

#include "selfcal/v1/segment.pb.h"

namespace selfcal::server {
namespace {

TEST(Shortened, CutsBetweenCharacters) {
  EXPECT_EQ(Shortened("short", 5), "short");
  EXPECT_EQ(Shortened("longer than that", 9), "longer...");
  // Two bytes a character: the ellipsis leaves room for one and a half.
  EXPECT_EQ(Shortened("\xc3\xa9\xc3\xa9\xc3\xa9\xc3\xa9", 6), "\xc3\xa9...");
}

TEST(Shortened, IsValidUtf8WhateverComes) {
  EXPECT_EQ(Shortened("a\xff\n\xc3", 9), "a???");
  EXPECT_EQ(Shortened("\xe2\x82\xac\xed\xa0\x80", 9), "\xe2\x82\xac???");
  EXPECT_EQ(Shortened("\xf0\x9f\x98\x80\xc0\x80", 9), "\xf0\x9f\x98\x80??");
  std::mt19937 engine(1);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 5000; ++i) {
    std::string text;
    for (int k = byte(engine) % 40; k > 0; --k) {
      text += static_cast<char>(byte(engine) | (k % 3 == 0 ? 0x80 : 0));
    }
    const std::string shortened = Shortened(text, 20);
    EXPECT_LE(shortened.size(), 20u);
    v1::Segment message;
    message.set_problem(shortened);
    EXPECT_TRUE(v1::Segment().ParseFromString(message.SerializeAsString()));
  }
}

}  // namespace
}  // namespace selfcal::server
