#include <thread>

#include "test/server/grpc/service_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using VerifyResponse = v1::VerifyRigResponse;

class VerifyRigTest : public ServiceTest {
 protected:
  grpc::Status Verify(const std::string& parent) {
    Context context;
    v1::VerifyRigRequest request;
    request.set_parent(parent);
    const auto reader = calibrations_->VerifyRig(&context, request);
    responses_.clear();
    VerifyResponse response;
    while (reader->Read(&response)) responses_.push_back(response);
    return reader->Finish();
  }

  std::vector<VerifyResponse> responses_;
};

TEST_F(VerifyRigTest, TellsStepsChecksAndASummary) {
  AddRig();
  pipeline_->verify_hook = [](const OnVerificationStep& on_step, const auto&) {
    Verification verification;
    verification.version = 3;
    ScoreCheck& score = verification.scores.emplace_back();
    score.segment = {"a b", 7};
    score.outcome = VerificationOutcome::kDiffers;
    score.difference = {1e-3, 2e-3, 3e-3, 1e-6};
    CalibrationCheck& check = verification.calibration.emplace();
    check.version = 3;
    check.message = "a solver did not converge";
    check.segments = 5;
    check.segments_gone = 2;
    on_step({0, 2, "segment a b~7", nullptr, nullptr});
    on_step({1, 2, "segment a b~7", &score, nullptr});
    on_step({2, 2, "calibration 3", nullptr, &check});
    return verification;
  };
  const auto status = Verify("rigs/r");
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(responses_.size(), 4u);
  EXPECT_EQ(responses_[0].progress().total(), 2);
  EXPECT_EQ(responses_[0].progress().subject(), "segment a b~7");
  EXPECT_EQ(responses_[1].score().segment(), "rigs/r/segments/a%20b~7");
  EXPECT_EQ(responses_[1].score().outcome(), VerifyResponse::DIFFERS);
  EXPECT_EQ(responses_[1].score().entropy_difference_nats(), 1e-3);
  EXPECT_EQ(responses_[2].calibration().outcome(),
            VerifyResponse::NOT_COMPARED);
  EXPECT_EQ(responses_[2].calibration().segments_gone(), 2);
  const auto& summary = responses_[3].summary();
  EXPECT_EQ(summary.version(), 3);
  EXPECT_EQ(summary.scores(), 1);
  EXPECT_EQ(summary.scores_differing(), 1);
  EXPECT_EQ(summary.scores_not_compared(), 0);
  EXPECT_EQ(summary.estimate_difference_sigmas(), 3e-3);
  EXPECT_EQ(summary.calibration().message(), "a solver did not converge");
  EXPECT_THAT(summary.finding(), ::testing::HasSubstr("a b~7"));
}

TEST_F(VerifyRigTest, EndsWhenItsCallerGoes) {
  AddRig();
  std::atomic<bool> begun = false;
  std::atomic<bool> interrupted = false;
  pipeline_->verify_hook =
      [&](const auto&,
          const std::function<bool()>& stop) -> absl::StatusOr<Verification> {
    begun = true;
    interrupted = Eventually(stop);
    return absl::CancelledError("interrupted");
  };
  Context context;
  v1::VerifyRigRequest request;
  request.set_parent("rigs/r");
  const auto reader = calibrations_->VerifyRig(&context, request);
  std::thread thread([&] {
    EXPECT_TRUE(Eventually([&] { return begun.load(); }));
    context.TryCancel();
  });
  VerifyResponse response;
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  thread.join();
  server_.reset();  // waits for its calls
  EXPECT_TRUE(interrupted);
}

TEST_F(VerifyRigTest, RefusesWhatItCannotAnswer) {
  AddRig();
  EXPECT_THAT(BadFields(Verify("r")), ElementsAre("parent"));
  ExpectNotFound(Verify("rigs/nobody"), "rigs/nobody");
  pipeline_->verify_hook = [](auto&&...) -> absl::StatusOr<Verification> {
    return absl::FailedPreconditionError("another one is under way");
  };
  EXPECT_EQ(Verify("rigs/r").error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
}

}  // namespace
}  // namespace selfcal::server
