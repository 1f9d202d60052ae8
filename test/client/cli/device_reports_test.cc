// `rig show` at a hub: what is known of the reports of the device.
#include <gmock/gmock.h>

#include "selfcal/v1/activity_service.grpc.pb.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;
using testing::Not;

struct ReportedRigDaemon final : v1::RigService::Service,
                                 v1::ActivityService::Service {
  v1::RigActivity activity;
  grpc::Status failure;  // of the activity

  grpc::Status GetRig(grpc::ServerContext*,
                      const v1::GetRigRequest*,
                      v1::Rig* response) override {
    *response = ToProto(ARig("tablet"));
    return grpc::Status::OK;
  }
  grpc::Status ListActivity(grpc::ServerContext*,
                            const v1::ListActivityRequest* request,
                            v1::ListActivityResponse* response) override {
    EXPECT_EQ(request->filter(), "name = \"tablet\"");
    *response->add_rigs() = activity;
    return failure;
  }

  GrpcServer server{{static_cast<v1::RigService::Service*>(this),
                     static_cast<v1::ActivityService::Service*>(this)}};
};

class DeviceReports : public testing::Test {
 protected:
  DeviceReports() {
    daemon_.activity.set_name("rigs/tablet");
    daemon_.server.Start();
  }

  void SetReports() {
    v1::ReportState* reports = daemon_.activity.mutable_device();
    reports->mutable_time()->set_seconds(1'795'234'203);
    reports->set_waiting(12);
    reports->set_program_version("1.2.3");
  }

  Outcome ShowRig() {
    return Selfcal(
        {"--target", daemon_.server.target(), "rig", "show", "tablet"});
  }

  ReportedRigDaemon daemon_;
};

TEST_F(DeviceReports, AreShownWithTheRig) {
  SetReports();
  const Outcome outcome = ShowRig();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              HasSubstr("last report\t2026-11-21 04:10:03\n"
                        "records waiting then\t12\n"
                        "device program\t1.2.3\n"));
}

TEST_F(DeviceReports, AreNotShownOfARigThatNoDeviceReports) {
  const Outcome outcome = ShowRig();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("rig\ttablet\n"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("last report")));
}

TEST_F(DeviceReports, AreNotNeededToShowTheRig) {
  SetReports();
  daemon_.failure = {grpc::StatusCode::INVALID_ARGUMENT, "unknown field"};
  const Outcome outcome = ShowRig();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("rig\ttablet\n"));
}

}  // namespace
}  // namespace selfcal::client
