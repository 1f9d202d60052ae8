#include "server/service/errors.h"

#include <gtest/gtest.h>

#include <random>

#include "google/rpc/status.pb.h"
#include "server/service/mailbox.h"
#include "server/encode/versions.h"

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;

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
    google::rpc::Status message;
    message.set_message(shortened);
    EXPECT_TRUE(
        google::rpc::Status().ParseFromString(message.SerializeAsString()));
  }
}

TEST(ToGrpc, KeepsTheCanonicalCode) {
  EXPECT_TRUE(ToGrpc(absl::OkStatus(), {}).ok());
  EXPECT_EQ(ToGrpc(absl::DataLossError("x"), {}).error_code(),
            grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(ToGrpc(absl::FailedPreconditionError("x"), {}).error_message(),
            "x");
}

TEST(Guarded, TurnsExceptionsIntoErrors) {
  EXPECT_TRUE(Guarded([] { return grpc::Status::OK; }).ok());
  const auto thrown =
      Guarded([]() -> grpc::Status { throw std::runtime_error("why"); });
  EXPECT_EQ(thrown.error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_EQ(thrown.error_message(), "why");
}

TEST(Mailbox, HoldsTheNewestOnce) {
  Mailbox<int> mailbox;
  EXPECT_EQ(mailbox.Take(milliseconds(0)), std::nullopt);
  mailbox.Put(1);
  mailbox.Put(2);
  EXPECT_EQ(mailbox.Take(milliseconds(0)), 2);
  EXPECT_EQ(mailbox.Take(milliseconds(0)), std::nullopt);
}

TEST(ParseCount, AcceptsNothingButANumberFromOneOn) {
  EXPECT_EQ(ParseCount("1"), 1);
  EXPECT_EQ(ParseCount("9223372036854775807"), 9223372036854775807);
  for (const std::string text :
       {"", "0", "-1", "+1", "01", "1 ", "1x", "9223372036854775808"}) {
    EXPECT_EQ(ParseCount(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace selfcal::server
