// The way to a hub over gRPC, and the settings for it.
#include <thread>

#include "server/grpc/server.h"
#include "test/server/uplink/uplink_fixture.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class GrpcHubTest : public UplinkFixture {
 protected:
  std::unique_ptr<Server> Serve() {
    ServerOptions options;
    options.listen = {address_};
    auto server = MakeServer(&*hub_.api, options);
    EXPECT_TRUE(server.ok()) << server.status();
    return *std::move(server);
  }

  v1::ReportRequest FirstReport() {
    CreateDeviceRig();
    Outbox* const outbox = device_.store->outbox();
    EXPECT_TRUE(outbox->BeginAnew("a", ReportedData::kNone).ok());
    const auto report = outbox->Next(outbox->List()->front(), 1 << 20);
    EXPECT_TRUE(report.ok()) << report.status();
    v1::ReportRequest request;
    request.set_rig("rigs/a");
    request.set_key(report->key);
    request.set_number(report->number);
    request.set_records(report->records);
    return request;
  }

  const TempFolder socket_folder_;
  const std::string address_ = "unix:" + socket_folder_.File("hub.sock");
};

TEST_F(GrpcHubTest, ReportsArriveAlsoAfterTheHubWasAway) {
  const v1::ReportRequest request = FirstReport();
  const auto hub = MakeGrpcHub({.hub = address_});
  EXPECT_TRUE(absl::IsUnavailable(hub->Report(request).status()));
  auto server = Serve();
  const auto response = hub->Report(request);
  ASSERT_TRUE(response.ok()) << response.status();
  EXPECT_TRUE(hub_.store->GetRig("a").ok());
  server->Shutdown(std::chrono::milliseconds(100));
  server.reset();
  EXPECT_TRUE(absl::IsUnavailable(hub->Report(request).status()));
  server = Serve();
  EXPECT_TRUE(hub->Report(request).ok());
}

TEST_F(GrpcHubTest, ErrorsOfTheHubArriveWithTheirCode) {
  v1::ReportRequest request = FirstReport();
  request.set_records("not a message");
  const auto server = Serve();
  const auto hub = MakeGrpcHub({.hub = address_});
  const absl::Status status = hub->Report(request).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("cannot be read"));
}

// The device tries again, and no rig is blamed.
TEST_F(GrpcHubTest, AHubWhoseTlsFilesCannotBeReadIsUnavailable) {
  const v1::ReportRequest request = FirstReport();
  const auto hub = MakeGrpcHub(
      {.hub = "hub.example:7447", .ca = socket_folder_.File("missing.pem")});
  const absl::Status status = hub->Report(request).status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("missing.pem"));
}

TEST_F(GrpcHubTest, CancelEndsAllReports) {
  const v1::ReportRequest request = FirstReport();
  const auto hub = MakeGrpcHub({.hub = address_});
  hub->Cancel();
  EXPECT_TRUE(absl::IsCancelled(hub->Report(request).status()));
}

TEST(CheckUplink, SettingsThatCannotWorkAreNamed) {
  const auto why = [](const UplinkOptions& options) {
    return std::string(CheckUplink(options).message());
  };
  EXPECT_EQ(why({}), "");
  EXPECT_EQ(why({.hub = "insecure:hub:1"}), "");
  EXPECT_EQ(why({.hub = "hub:1"}), "");
  EXPECT_THAT(why({.ca = "/ca"}), HasSubstr("without uplink"));
  EXPECT_THAT(why({.hub = "insecure:hub:1", .ca = "/ca"}),
              HasSubstr("not encrypted"));
  EXPECT_THAT(why({.hub = "hub:1", .certificate = "/c"}),
              HasSubstr("uplink-tls-key"));
  EXPECT_THAT(why({.hub = "hub:1", .ca = "/no/such/file"}),
              HasSubstr("/no/such/file"));
}

}  // namespace
}  // namespace selfcal::server
