// Commands about a rig that a device reports: a hub refuses the call, and the
// device is instructed to make it.
#include <gmock/gmock.h>

#include "selfcal/v1/activity_service.grpc.pb.h"
#include "selfcal/v1/fleet.grpc.pb.h"
#include "selfcal/v1/uplink.grpc.pb.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const grpc::Status kRefused = {grpc::StatusCode::FAILED_PRECONDITION,
                               "a device reports the rig"};

struct CannedHub final : v1::RigService::Service,
                         v1::FleetService::Service,
                         v1::SegmentService::Service,
                         v1::CalibrationService::Service,
                         v1::RecalibrationService::Service,
                         v1::ActivityService::Service,
                         v1::UplinkService::Service {
  bool reported = true;
  bool refuses_instructions = false;
  v1::CreateInstructionRequest given;

  grpc::Status GetRig(grpc::ServerContext*,
                      const v1::GetRigRequest* request,
                      v1::Rig* response) override {
    response->set_name(request->name());
    return grpc::Status::OK;
  }
  grpc::Status ListRigs(grpc::ServerContext*,
                        const v1::ListRigsRequest*,
                        v1::ListRigsResponse* response) override {
    v1::Rig* rig = response->add_rigs();
    *rig = ToProto(ARig("tablet"));
    (*rig->mutable_labels())["model"] = "t4";
    return grpc::Status::OK;
  }
  grpc::Status ListCohorts(grpc::ServerContext*,
                           const v1::ListCohortsRequest* request,
                           v1::ListCohortsResponse* response) override {
    v1::CohortVersion* version = response->add_cohorts();
    version->set_label(request->label());
    version->set_value(request->value());
    version->set_version(1);
    Rig prior = ARig("prior");
    prior.factory.cameras[0].f.x() += 3;
    *version->mutable_cohort()->mutable_prior() = ToProto(prior);
    v1::CohortComponent* focal = version->mutable_cohort()->add_components();
    focal->set_component("cam0.focal.x");
    focal->set_spread_degrees(10);
    return grpc::Status::OK;
  }
  grpc::Status UpdateRig(grpc::ServerContext*,
                         const v1::UpdateRigRequest*,
                         v1::Rig*) override {
    return kRefused;
  }
  grpc::Status ActivateCalibration(grpc::ServerContext*,
                                   const v1::ActivateCalibrationRequest*,
                                   v1::Calibration*) override {
    return kRefused;
  }
  grpc::Status QuarantineSegments(grpc::ServerContext*,
                                  const v1::QuarantineSegmentsRequest*,
                                  v1::QuarantineSegmentsResponse*) override {
    return kRefused;
  }
  grpc::Status StartRecalibration(grpc::ServerContext*,
                                  const v1::StartRecalibrationRequest*,
                                  v1::Recalibration*) override {
    return kRefused;
  }
  grpc::Status ListActivity(grpc::ServerContext*,
                            const v1::ListActivityRequest* request,
                            v1::ListActivityResponse* response) override {
    EXPECT_EQ(request->filter(), "name = \"tablet\"");
    v1::RigActivity* rig = response->add_rigs();
    rig->set_name("rigs/tablet");
    if (reported) rig->mutable_device();
    return grpc::Status::OK;
  }
  grpc::Status CreateInstruction(grpc::ServerContext*,
                                 const v1::CreateInstructionRequest* request,
                                 v1::Instruction* response) override {
    if (refuses_instructions) {
      return {grpc::StatusCode::PERMISSION_DENIED, "not for you"};
    }
    given = *request;
    *response = request->instruction();
    response->set_name(request->parent() + "/instructions/4");
    return grpc::Status::OK;
  }

  grpc::Status ListInstructions(
      grpc::ServerContext*,
      const v1::ListInstructionsRequest* request,
      v1::ListInstructionsResponse* response) override {
    for (const int number : {1, 2}) {
      v1::Instruction* one = response->add_instructions();
      one->set_name(request->parent() + "/instructions/" +
                    std::to_string(number));
      v1::QuarantineSegmentsRequest* of = one->mutable_quarantine_segments();
      of->set_session("walk");
      of->set_reason("diverged");
      if (number == 1) of->set_index(7);
    }
    return grpc::Status::OK;
  }

  GrpcServer server{{static_cast<v1::RigService::Service*>(this),
                     static_cast<v1::FleetService::Service*>(this),
                     static_cast<v1::SegmentService::Service*>(this),
                     static_cast<v1::CalibrationService::Service*>(this),
                     static_cast<v1::RecalibrationService::Service*>(this),
                     static_cast<v1::ActivityService::Service*>(this),
                     static_cast<v1::UplinkService::Service*>(this)}};
};

class Instructions : public testing::Test {
 protected:
  Instructions() { hub_.server.Start(); }

  Outcome AtHub(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--target", hub_.server.target()});
    return Selfcal(arguments);
  }

  // The instruction that the command gives.
  v1::Instruction GivenBy(std::vector<std::string> arguments) {
    hub_.given.Clear();
    const Outcome outcome = AtHub(std::move(arguments));
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_THAT(outcome.out,
                AllOf(HasSubstr("instruction 4"), HasSubstr("tablet")));
    EXPECT_EQ(hub_.given.parent(), "rigs/tablet");
    return hub_.given.instruction();
  }

  CannedHub hub_;
};

TEST_F(Instructions, AreGivenByTheCommandsThatChangeARig) {
  const auto activate =
      GivenBy({"calibration", "activate", "tablet", "3", "--reason", "better"});
  EXPECT_EQ(activate.activate_calibration().name(),
            "rigs/tablet/calibrations/3");
  EXPECT_EQ(activate.activate_calibration().reason(), "better");
  const auto update = GivenBy({"rig", "update", "tablet", "--label", "a=b"});
  EXPECT_EQ(update.update_rig().rig().labels().at("a"), "b");
  const auto prior = GivenBy({"cohort",
                              "apply",
                              "model=t4",
                              "--filter",
                              "labels.model = t4",
                              "--reason",
                              "new statistics",
                              "--yes"});
  EXPECT_EQ(prior.update_rig().rig().prior_mean().cameras(0).f().x(), 258);
  EXPECT_EQ(prior.update_rig().reason(), "new statistics");
  const auto quarantine = GivenBy(
      {"segment", "quarantine", "tablet", "walk~7", "--reason", "diverged"});
  EXPECT_EQ(quarantine.quarantine_segments().session(), "walk");
  EXPECT_EQ(quarantine.quarantine_segments().index(), 7);
  const auto start = GivenBy({"run", "start", "tablet", "--force"});
  EXPECT_EQ(start.start_recalibration().parent(), "rigs/tablet");
  EXPECT_TRUE(start.start_recalibration().force());
}

TEST_F(Instructions, AreListedWithTheSegmentsThatTheyConcern) {
  const Outcome outcome = AtHub({"instruction", "list", "tablet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(
      outcome.out,
      AllOf(HasSubstr("quarantine segment walk~7: diverged"),
            HasSubstr("quarantine segments of session walk: diverged")));
}

TEST_F(Instructions, AreNotGivenForARigOfTheDaemonItself) {
  hub_.reported = false;
  const Outcome outcome = AtHub({"run", "start", "tablet"});
  EXPECT_NE(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("a device reports the rig"));
  EXPECT_TRUE(hub_.given.parent().empty());
}

TEST_F(Instructions, ThatAreRefusedAreErrors) {
  hub_.refuses_instructions = true;
  const Outcome outcome = AtHub({"run", "start", "tablet"});
  EXPECT_NE(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("not for you"));
}

}  // namespace
}  // namespace selfcal::client
