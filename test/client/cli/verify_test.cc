#include <gmock/gmock.h>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using ::testing::HasSubstr;
using Response = v1::VerifyRigResponse;

Response Score(const std::string& index,
               Response::Outcome outcome,
               const std::string& message = "") {
  Response response;
  response.mutable_score()->set_segment("rigs/device/segments/s~" + index);
  response.mutable_score()->set_outcome(outcome);
  response.mutable_score()->set_entropy_difference_nats(2.5e-10);
  response.mutable_score()->set_information_difference(1.2e-9);
  response.mutable_score()->set_estimate_difference_sigmas(3e-9);
  response.mutable_score()->set_message(message);
  return response;
}

Response Calibration() {
  Response response;
  auto* check = response.mutable_calibration();
  check->set_version(4);
  check->set_outcome(Response::AGREES);
  check->set_theta_difference_sigmas(0.012);
  check->set_theta_component("cam0.focal.x");
  check->set_sigma_difference(0.001);
  check->set_sigma_component("imu.gyro.scale.x");
  check->set_covariance_difference(0.002);
  check->set_segments(11);
  check->set_segments_gone(1);
  return response;
}

Response Summary() {
  Response response;
  auto* summary = response.mutable_summary();
  summary->set_scores(2);
  summary->set_version(4);
  *summary->mutable_calibration() = Calibration().calibration();
  return response;
}

TEST_F(Commands, VerifyPrintsEachCheckAndASummary) {
  daemon_.verification = {
      Score("0", Response::AGREES), Calibration(), Summary()};
  const Outcome outcome = Selfcal({"verify", "device"});
  EXPECT_EQ(outcome.code, kDone) << outcome.err;
  EXPECT_EQ(daemon_.last_name, "rigs/device");
  EXPECT_THAT(outcome.out,
              HasSubstr("segment s~0\tagrees\tentropy 2.5e-10 nat, "
                        "information 1.2e-09, estimate 3e-09 sigma\n"));
  EXPECT_THAT(outcome.out,
              HasSubstr("calibration 4\tagrees\tcam0.focal.x 0.012 sigma, "
                        "sigma of imu.gyro.scale.x 0.1 %, covariance 0.2 %\n"));
  EXPECT_THAT(outcome.out,
              HasSubstr("segments\t11, 1 of the version are no longer kept\n"));
}

TEST_F(Commands, VerifyFailsWhereTheCoresDiffer) {
  Response summary = Summary();
  summary.mutable_summary()->set_scores_differing(1);
  summary.mutable_summary()->set_finding("the two cores disagree on s~0");
  daemon_.verification = {Score("0", Response::DIFFERS), summary};
  const Outcome outcome = Selfcal({"verify", "device"});
  EXPECT_EQ(outcome.code, kFailed);
  EXPECT_THAT(outcome.out, HasSubstr("segment s~0\tdiffers\t"));
  EXPECT_THAT(outcome.err,
              HasSubstr("version 4 is not trustworthy: the two cores disagree "
                        "on s~0"));
}

TEST_F(Commands, VerifyFailsWhereSomethingWasNotComparedOrTheEndIsMissing) {
  Response summary = Summary();
  summary.mutable_summary()->set_scores_not_compared(1);
  daemon_.verification = {Score("0", Response::NOT_COMPARED, "no memory"),
                          summary};
  Outcome outcome = Selfcal({"verify", "device"});
  EXPECT_EQ(outcome.code, kFailed);
  EXPECT_THAT(outcome.out, HasSubstr("not compared: no memory"));
  EXPECT_THAT(outcome.err, HasSubstr("not everything could be compared"));
  daemon_.verification = {Score("0", Response::AGREES)};
  outcome = Selfcal({"verify", "device"});
  EXPECT_EQ(outcome.code, kFailed);
  EXPECT_THAT(outcome.err, HasSubstr("without a summary"));
  daemon_.verification.clear();
  EXPECT_EQ(Selfcal({"verify", "device"}).code, kFailed);
}

TEST_F(Commands, VerifyPrintsALineOfJsonAResponse) {
  daemon_.verification = {Score("0", Response::AGREES), Summary()};
  const Outcome outcome = Selfcal({"verify", "device", "--json"});
  EXPECT_EQ(outcome.code, kDone) << outcome.err;
  EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '\n'), 2);
  EXPECT_THAT(outcome.out, HasSubstr("\"estimate_difference_sigmas\":3e-09"));
}

}  // namespace
}  // namespace selfcal::client
