#include "proto/safe_text.h"

#include <gtest/gtest.h>

#include <random>

#include "selfcal/v1/segment.pb.h"

namespace selfcal {
namespace {

TEST(SafeLine, CutsBetweenCharacters) {
  EXPECT_EQ(SafeLine("short", 5), "short");
  EXPECT_EQ(SafeLine("longer than that", 9), "longer...");
  // Two bytes a character: the ellipsis leaves room for one and a half.
  EXPECT_EQ(SafeLine("\xc3\xa9\xc3\xa9\xc3\xa9\xc3\xa9", 6), "\xc3\xa9...");
}

TEST(SafeLine, NothingControlsATerminalALineOrTheDirection) {
  EXPECT_EQ(SafeLine("a\033[2Jb\r\n\tc\x7f"), "a?[2Jb???c?");
  EXPECT_EQ(SafeLine(std::string_view("a\0b", 3)), "a?b");
  // NEL of C1, line separator, right-to-left override, isolate, Arabic mark.
  EXPECT_EQ(SafeLine("\xc2\x85\xe2\x80\xa8\xe2\x80\xae\xe2\x81\xa6\xd8\x9c"),
            "?????");
  // Neighbours of these, which are letters, blanks or punctuation.
  const std::string harmless =
      "\xc2\xa0\xe2\x80\xa7\xe2\x80\xaf\xe2\x81\xa5\xd8\x9b";
  EXPECT_EQ(SafeLine(harmless), harmless);
}

TEST(SafeLines, KeepsLinesAndTabs) {
  EXPECT_EQ(SafeLines("a\tb\nc\r\033"), "a\tb\nc??");
}

TEST(SafeLine, IsValidUtf8WhateverComes) {
  EXPECT_EQ(SafeLine("a\xff\n\xc3", 9), "a???");
  EXPECT_EQ(SafeLine("\xe2\x82\xac\xed\xa0\x80", 9), "\xe2\x82\xac???");
  EXPECT_EQ(SafeLine("\xf0\x9f\x98\x80\xc0\x80", 9), "\xf0\x9f\x98\x80??");
  std::mt19937 engine(1);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 5000; ++i) {
    std::string text;
    for (int k = byte(engine) % 40; k > 0; --k) {
      text += static_cast<char>(byte(engine) | (k % 3 == 0 ? 0x80 : 0));
    }
    const std::string safe = SafeLine(text, 20);
    EXPECT_LE(safe.size(), 20u);
    v1::Segment message;
    message.set_problem(safe);
    EXPECT_TRUE(v1::Segment().ParseFromString(message.SerializeAsString()));
  }
}

}  // namespace
}  // namespace selfcal
