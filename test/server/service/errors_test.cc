#include "server/service/errors.h"

#include <gtest/gtest.h>

#include "google/rpc/status.pb.h"
#include "server/service/mailbox.h"
#include "server/encode/versions.h"

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;

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
