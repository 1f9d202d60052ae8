#include "test/server/console/console_test.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using AccessTest = ConsoleTest;

constexpr char kActivate[] = "/api/v1/rigs/r/calibrations/1:activate";
constexpr char kReason[] = R"({"reason": "it was better"})";

TEST_F(AccessTest, ReadingIsAllThatTheLoopbackMayDo) {
  AddVersion(AddRig("r"));
  const Reply refused = Post(kActivate, kReason);
  EXPECT_EQ(refused.status, 403) << refused.body;
  EXPECT_EQ(refused.code(), "PERMISSION_DENIED");
  EXPECT_EQ(store_->GetActiveCalibration("r")->version, 2);
  EXPECT_EQ(Get("/api/v1/caller").json()["grants"][0]["role"], "read");
}

TEST_F(AccessTest, WhoMayActivatesWithAReason) {
  AddVersion(AddRig("r"));
  Open(Role::kAdminister);
  EXPECT_EQ(Post(kActivate, "{}").status, 400);
  EXPECT_EQ(Post(kActivate, "no json").status, 400);
  EXPECT_EQ(Post("/api/v1/rigs/r/calibrations/x:activate", kReason).status,
            400);
  EXPECT_EQ(Post("/api/v1/rigs/r/calibrations/9:activate", kReason).status,
            404);
  EXPECT_EQ(Post("/api/v1/rigs/r/calibrations/1", kReason).status, 405);
  EXPECT_EQ(store_->GetActiveCalibration("r")->version, 2);
  const Reply done = Post(kActivate, kReason);
  EXPECT_EQ(done.status, 200) << done.body;
  EXPECT_EQ(done.json()["version"], "1");
  EXPECT_EQ(store_->GetActiveCalibration("r")->version, 1);
  const auto event =
      Get("/api/v1/rigs/r/events?order_by=number%20desc").json()["events"][0];
  EXPECT_EQ(event["kind"], "CALIBRATION_ROLLED_BACK");
  EXPECT_THAT(event["detail"].get<std::string>(), HasSubstr("it was better"));
}

TEST_F(AccessTest, ChangeNeedsTheHeaderThatOtherSitesCannotSend) {
  AddVersion(AddRig("r"));
  Open(Role::kAdminister);
  EXPECT_EQ(Post(kActivate, kReason, "").status, 403);
  EXPECT_EQ(store_->GetActiveCalibration("r")->version, 2);
}

TEST_F(AccessTest, EachKindOfChangeNeedsRoleAndHeader) {
  AddRig("r");
  const std::string labels = R"({"name": "rigs/r", "labels": {"site": "lab"}})";
  const auto label = [&](const std::string& headers) {
    return Change("PATCH", "/api/v1/rigs/r?updateMask=labels", labels, headers)
        .status;
  };
  const auto remove = [&](const std::string& headers) {
    return Change("DELETE", "/api/v1/rigs/r?reason=retired", "", headers)
        .status;
  };
  EXPECT_EQ(label(kConsoleHeader), 403);
  EXPECT_EQ(remove(kConsoleHeader), 403);
  Open(Role::kAdminister);
  EXPECT_EQ(label(""), 403);
  EXPECT_EQ(remove(""), 403);
  EXPECT_TRUE(store_->GetRig("r")->labels.empty());

  EXPECT_EQ(label(kConsoleHeader), 200);
  EXPECT_EQ(store_->GetRig("r")->labels.at("site"), "lab");
  EXPECT_EQ(remove(kConsoleHeader), 200);
  EXPECT_TRUE(absl::IsNotFound(store_->GetRig("r").status()));
  EXPECT_EQ(Change("PUT", "/api/v1/rigs/r", labels).status, 405);
}

TEST_F(AccessTest, NamesThatWereMadeToPointHereAreRefused) {
  AddRig("r");
  for (const char* host : {"evil.example",
                           "127.0.0.1.evil.example:80",
                           "[::1].evil.example",
                           "[::1]:80.evil.example",
                           "localhost:evil.example",
                           "[::1",
                           ""}) {
    const Reply reply = Get("/api/v1/rigs", host);
    EXPECT_GE(reply.status, 400) << host;
    EXPECT_EQ(reply.body.find("rigs/r"), std::string::npos) << host;
  }
  for (const char* host : {"127.0.0.1:7448", "localhost", "[::1]:80"}) {
    EXPECT_EQ(Get("/api/v1/rigs", host).status, 200) << host;
  }
}

TEST_F(AccessTest, AnswersKeepOtherSitesOut) {
  for (const char* path : {"/", "/api/v1/rigs", "/api/v1/none"}) {
    const Reply reply = Get(path);
    EXPECT_THAT(reply.head,
                HasSubstr("Content-Security-Policy: default-src 'self'"));
    EXPECT_THAT(reply.head, HasSubstr("X-Content-Type-Options: nosniff"));
    EXPECT_EQ(reply.head.find("Access-Control"), std::string::npos);
  }
}

TEST_F(AccessTest, AddressesOffTheLoopbackNeedTls) {
  for (const char* address :
       {"0.0.0.0:0", "10.0.0.1:80", "[::]:80", "localhost:80", "80", ""}) {
    ConsoleOptions options;
    options.address = address;
    EXPECT_TRUE(absl::IsInvalidArgument(CheckConsole(options))) << address;
  }
  ConsoleOptions options;
  options.address = "[::1]:0";
  EXPECT_TRUE(CheckConsole(options).ok());
  options.address = "0.0.0.0:0";
  options.tls = {"/none", "/none", "/none"};
  EXPECT_TRUE(absl::IsFailedPrecondition(CheckConsole(options)));
}

TEST_F(AccessTest, PortThatIsTakenIsAnError) {
  const auto second = MakeConsole(
      &*api_, {"127.0.0.1:" + std::to_string(port()), Role::kRead, {}});
  EXPECT_TRUE(absl::IsUnavailable(second.status())) << second.status();
}

}  // namespace
}  // namespace selfcal::server
