#include "server/console/outbox.h"

#include <gtest/gtest.h>

namespace selfcal::server {
namespace {

constexpr std::chrono::milliseconds kNow{0};

TEST(Outbox, LinesWaitInOrderEachOnce) {
  Outbox outbox("all");
  outbox.Put("a");
  outbox.Put("b");
  outbox.Put("a");
  EXPECT_EQ(outbox.Take(kNow), "ab");
  EXPECT_EQ(outbox.Take(kNow), "");
  outbox.Put("a");
  EXPECT_EQ(outbox.Take(kNow), "a");
}

TEST(Outbox, WhatWaitsIsTakenBeforeTheEnd) {
  Outbox outbox("all");
  outbox.Put("a");
  outbox.Close();
  outbox.Put("late");
  EXPECT_EQ(outbox.Take(kNow), "a");
  EXPECT_EQ(outbox.Take(kNow), std::nullopt);
}

TEST(Outbox, TooManyLinesBecomeOne) {
  Outbox outbox("all");
  for (int i = 0; i < 257; ++i) outbox.Put(std::to_string(i));
  EXPECT_EQ(outbox.Take(kNow), "all");
}

}  // namespace
}  // namespace selfcal::server
