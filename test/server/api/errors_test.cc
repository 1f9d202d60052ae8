#include "server/api/errors.h"

#include <gtest/gtest.h>

#include "google/rpc/error_details.pb.h"
#include "server/encode/versions.h"

namespace selfcal::server {
namespace {

template <typename Detail>
Detail DetailOf(const absl::Status& status) {
  Detail detail;
  const auto message = ToMessage(status);
  for (const auto& any : message.details()) {
    if (any.UnpackTo(&detail)) return detail;
  }
  ADD_FAILURE() << "no " << detail.GetTypeName() << " in " << status;
  return detail;
}

TEST(Errors, KeepTheCanonicalCodeAndTheMessage) {
  EXPECT_TRUE(ForClient(absl::OkStatus()).ok());
  EXPECT_TRUE(About(absl::OkStatus(), {}).ok());
  const auto message = ToMessage(ForClient(absl::DataLossError("x")));
  EXPECT_EQ(message.code(), static_cast<int>(absl::StatusCode::kDataLoss));
  EXPECT_EQ(message.message(), "x");
}

TEST(Errors, SayWhatTheyAreAbout) {
  const Subject subject{"selfcal.v1.Rig", "rigs/a", "parent"};
  EXPECT_EQ(DetailOf<google::rpc::ResourceInfo>(
                About(absl::NotFoundError("x"), subject))
                .resource_name(),
            "rigs/a");
  const auto violation = DetailOf<google::rpc::BadRequest>(
                             About(absl::InvalidArgumentError("x"), subject))
                             .field_violations(0);
  EXPECT_EQ(violation.field(), "parent");
  EXPECT_EQ(violation.description(), "x");
}

TEST(Errors, SayWhenToTryAgain) {
  for (const absl::Status& status :
       {ForClient(absl::UnavailableError("x")),
        ForClient(absl::ResourceExhaustedError("x")),
        ShuttingDown()}) {
    EXPECT_GT(DetailOf<google::rpc::RetryInfo>(status).retry_delay().seconds(),
              0);
  }
}

// The trailer of gRPC takes 8 KiB.
TEST(Errors, AreSmall) {
  const std::string large(100'000, 'x');
  const std::vector<Violation> many(1000, Violation{large, large});
  EXPECT_LT(ToMessage(ForClient(InvalidFields(many))).ByteSizeLong(), 6000u);
  EXPECT_LT(ToMessage(ForClient(About(absl::NotFoundError(large),
                                      {"selfcal.v1.Rig", large, {}})))
                .ByteSizeLong(),
            6000u);
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
