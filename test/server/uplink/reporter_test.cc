// Rounds of reports, step by step.
#include "server/uplink/reporter.h"

#include "proto/convert.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/store_service.pb.h"
#include "server/store/events.h"
#include "server/store/reporting_device.h"
#include "test/server/uplink/uplink_fixture.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class ReporterTest : public UplinkFixture {
 protected:
  void Begin(const UplinkOptions& options = {}) {
    reporter_.emplace(
        device_.store.get(), &*device_.api, &way_, options, "1.2.3");
  }

  Reporter::Round Report() {
    const auto round = reporter_->ReportOnce(now_, [this](std::int64_t bytes) {
      paced_ += bytes;
      return true;
    });
    EXPECT_TRUE(round.ok()) << round.status();
    return round.value_or(Reporter::Round());
  }

  v1::Instruction Give(const v1::Instruction& instruction) {
    v1::CreateInstructionRequest request;
    request.set_parent("rigs/a");
    *request.mutable_instruction() = instruction;
    v1::Instruction given;
    const absl::Status status = CallHub(request, &given);
    EXPECT_TRUE(status.ok()) << status;
    return given;
  }

  static v1::Instruction NewLabel(const std::string& value) {
    v1::Instruction instruction;
    auto* rig = instruction.mutable_update_rig()->mutable_rig();
    rig->set_name("rigs/a");
    (*rig->mutable_labels())["batch"] = value;
    return instruction;
  }

  void PutEvents(int count) {
    const auto append = [&](UnitOfWork* tx) {
      absl::Status status;
      for (int k = 0; k < count && status.ok(); ++k) {
        status = AppendEvent(tx, EventKind::kRigUpdated, "of the test");
      }
      return status;
    };
    const absl::Status status = device_.store->Transact("a", 1, append);
    ASSERT_TRUE(status.ok()) << status;
  }

  v1::Instruction NewestInstruction() {
    v1::ListInstructionsRequest request;
    request.set_parent("rigs/a");
    v1::ListInstructionsResponse response;
    EXPECT_TRUE(CallHub(request, &response).ok());
    EXPECT_GT(response.instructions_size(), 0);
    return response.instructions_size() > 0 ? response.instructions(0)
                                            : v1::Instruction();
  }

  FakeHub way_{&*hub_.api};
  std::optional<Reporter> reporter_;
  Reporter::Time now_{};
  std::int64_t paced_ = 0;
};

TEST_F(ReporterTest, NewRigsAndWhatChangesAreReported) {
  CreateDeviceRig();
  Begin();
  const Reporter::Round first = Report();
  EXPECT_EQ(first.reports, 1);
  EXPECT_EQ(first.waiting, 0);
  EXPECT_EQ(paced_, first.bytes);
  EXPECT_GT(first.bytes, 1000);
  EXPECT_TRUE(hub_.store->GetRig("a").ok());
  EXPECT_EQ(Report().reports, 0);
  Put(0);
  EXPECT_EQ(Report().reports, 1);
  EXPECT_EQ(SegmentsAtHub(), 1u);
  const auto summary = hub_.store->ListRigSummaries({}, {});
  ASSERT_TRUE(summary.ok()) << summary.status();
  ASSERT_TRUE(summary->items[0].device.has_value());
  EXPECT_EQ(summary->items[0].device->program_version, "1.2.3");
}

TEST_F(ReporterTest, WhatTheHubDoesNotTakeWaits) {
  CreateDeviceRig();
  Begin();
  Report();
  way_.reachable = false;
  Put(0);
  EXPECT_TRUE(absl::IsUnavailable(Report().status));
  Put(1);
  way_.reachable = true;
  way_.answers_lost = 1;
  EXPECT_FALSE(Report().status.ok());
  EXPECT_EQ(SegmentsAtHub(), 2u);
  EXPECT_TRUE(Report().status.ok());
  EXPECT_EQ(SegmentsAtHub(), 2u);
  EXPECT_EQ(device_.store->outbox()->List()->front().waiting, 0);
}

// They may have reached the hub, and cost as much as those that it takes.
TEST_F(ReporterTest, FailedReportsAreCharged) {
  CreateDeviceRig("a");
  Begin();
  way_.reachable = false;
  const Reporter::Round unreachable = Report();
  EXPECT_TRUE(absl::IsUnavailable(unreachable.status));
  EXPECT_GT(unreachable.bytes, 1000);
  EXPECT_EQ(paced_, unreachable.bytes);
  way_.reachable = true;
  way_.answers_lost = 1;
  paced_ = 0;
  EXPECT_FALSE(Report().status.ok());
  EXPECT_EQ(paced_, unreachable.bytes);
  // A refusal, too.
  way_.caller.grants.clear();
  paced_ = 0;
  EXPECT_NE(Report().refusal, "");
  EXPECT_EQ(paced_, unreachable.bytes);
}

TEST_F(ReporterTest, NothingIsSentAfterAStop) {
  CreateDeviceRig("a");
  Begin();
  const auto round =
      reporter_->ReportOnce(now_, [](std::int64_t) { return false; });
  ASSERT_TRUE(round.ok()) << round.status();
  EXPECT_TRUE(absl::IsCancelled(round->status));
  EXPECT_EQ(way_.calls, 0);
}

TEST_F(ReporterTest, AReportFollowsAfterTheInterval) {
  CreateDeviceRig();
  Begin({.interval_s = 10});
  Report();
  now_ += std::chrono::milliseconds(9'999);
  EXPECT_EQ(Report().reports, 0);
  now_ += std::chrono::milliseconds(2);
  EXPECT_EQ(Report().reports, 1);
  EXPECT_EQ(Report().reports, 0);
}

TEST_F(ReporterTest, ARefusedRigDoesNotHoldUpOthers) {
  EXPECT_TRUE(hub_.domain->CreateRig(TestRig("a")).ok());
  CreateDeviceRig("a");
  CreateDeviceRig("b");
  Begin();
  const Reporter::Round round = Report();
  EXPECT_EQ(round.reports, 1);
  EXPECT_TRUE(round.status.ok()) << round.status;
  EXPECT_THAT(round.refusal,
              HasSubstr("of its own: give the rig of the device another name"));
  EXPECT_TRUE(hub_.store->GetRig("b").ok());
  // It is tried again later, not all the time.
  const int calls = way_.calls;
  EXPECT_NE(Report().refusal, "");
  EXPECT_EQ(way_.calls, calls);
  now_ += std::chrono::seconds(1);
  Report();
  EXPECT_EQ(way_.calls, calls + 1);
}

TEST_F(ReporterTest, ADeviceReportsOnlyRigsOfItsCertificate) {
  CreateDeviceRig("a");
  CreateDeviceRig("b");
  way_.caller.grants = {{Role::kProduce, "b"}};
  Begin();
  EXPECT_THAT(Report().refusal, HasSubstr("needs the role 'produce'"));
  EXPECT_FALSE(hub_.store->GetRig("a").ok());
  EXPECT_TRUE(hub_.store->GetRig("b").ok());
}

TEST_F(ReporterTest, InstructionsAreCarriedOutAndTheirResultIsTold) {
  CreateDeviceRig();
  Begin();
  Report();
  const v1::Instruction given = Give(NewLabel("2026-11"));
  EXPECT_EQ(given.state(), v1::Instruction::PENDING);
  EXPECT_EQ(given.caller(), "operator");
  now_ += std::chrono::minutes(1);
  Report();
  EXPECT_EQ(device_.store->GetRig("a")->labels.at("batch"), "2026-11");
  Report();
  EXPECT_EQ(NewestInstruction().state(), v1::Instruction::DONE);
  EXPECT_EQ(hub_.store->GetRig("a")->labels.at("batch"), "2026-11");
  // The device records who it was.
  const auto events = device_.store->ListNewestEvents({1, ""}, "a");
  ASSERT_TRUE(events.ok()) << events.status();
  EXPECT_THAT(events->items[0].detail, HasSubstr("hub/operator"));
}

TEST_F(ReporterTest, APriorComesDownToTheDevice) {
  const Rig rig = CreateDeviceRig();
  Begin();
  Report();
  Calibration mean = rig.factory;
  mean.cameras[0].f.x() += 1;
  v1::Instruction instruction;
  v1::UpdateRigRequest* const update = instruction.mutable_update_rig();
  update->mutable_rig()->set_name("rigs/a");
  *update->mutable_rig()->mutable_prior_mean() = ToProto(mean);
  v1::ComponentSetting* const sigma = update->mutable_rig()->add_prior_sigmas();
  sigma->set_pattern("cam0.focal.x");
  sigma->set_value(0.5);
  update->mutable_update_mask()->add_paths("prior_mean");
  update->mutable_update_mask()->add_paths("prior_sigmas");
  update->set_reason("as its cohort");
  Give(instruction);
  now_ += std::chrono::minutes(1);
  Report();
  Report();
  EXPECT_EQ(NewestInstruction().state(), v1::Instruction::DONE);
  for (Store* const store : {device_.store.get(), hub_.store.get()}) {
    const auto stored = store->GetRig("a");
    ASSERT_TRUE(stored.ok()) << stored.status();
    EXPECT_EQ(PriorMean(stored->rig).cameras[0].f.x(), mean.cameras[0].f.x());
    ASSERT_EQ(stored->rig.prior_sigmas.size(), 1u);
    EXPECT_EQ(stored->rig.prior_sigmas[0].value, 0.5);
  }
  const auto events = device_.store->ListNewestEvents({1, ""}, "a");
  ASSERT_TRUE(events.ok()) << events.status();
  EXPECT_THAT(events->items[0].detail,
              HasSubstr("hub/operator: as its cohort"));
}

TEST_F(ReporterTest, AnInstructionTheDeviceRefusesIsToldWithTheReason) {
  CreateDeviceRig();
  Begin();
  Report();
  v1::Instruction instruction;
  auto* activate = instruction.mutable_activate_calibration();
  activate->set_name("rigs/a/calibrations/7");
  activate->set_reason("a trial");
  Give(instruction);
  now_ += std::chrono::minutes(1);
  Report();
  Report();
  const v1::Instruction ended = NewestInstruction();
  EXPECT_EQ(ended.state(), v1::Instruction::REFUSED);
  EXPECT_THAT(ended.message(), HasSubstr("calibration 7"));
}

TEST_F(ReporterTest, AHubHasNoMoreRightsThanItsRole) {
  CreateDeviceRig();
  Begin({.role = Role::kRead});
  Report();
  Give(NewLabel("x"));
  now_ += std::chrono::minutes(1);
  Report();
  Report();
  EXPECT_EQ(NewestInstruction().state(), v1::Instruction::REFUSED);
  EXPECT_TRUE(device_.store->GetRig("a")->labels.empty());
}

TEST_F(ReporterTest, AnInstructionActsOnItsRigAlone) {
  CreateDeviceRig("a");
  CreateDeviceRig("b");
  Begin();
  Report();
  // As no hub of this program would store it.
  v1::Instruction of_b = NewLabel("x");
  of_b.mutable_update_rig()->mutable_rig()->set_name("rigs/b");
  ASSERT_TRUE(
      hub_.domain->CreateInstruction("a", "eve", of_b.SerializeAsString())
          .ok());
  now_ += std::chrono::minutes(1);
  Report();
  EXPECT_TRUE(device_.store->GetRig("b")->labels.empty());
}

TEST_F(ReporterTest, ResultsOutliveAHubThatHasLostRecords) {
  CreateDeviceRig();
  Begin();
  Report();
  Give(NewLabel("x"));
  now_ += std::chrono::minutes(1);
  Report();
  // The hub is put back to before the last report.
  ASSERT_TRUE(hub_.store
                  ->Transact("a",
                             1,
                             [](UnitOfWork* tx) -> absl::Status {
                               auto device = ReadReportingDevice(tx);
                               if (!device.ok()) return device.status();
                               (*device)->report -= 2;
                               return WriteReportingDevice(tx, **device);
                             })
                  .ok());
  Report();  // begins anew
  Report();
  EXPECT_EQ(NewestInstruction().state(), v1::Instruction::DONE);
}

TEST_F(ReporterTest, AHubThatNeverTakesSomeRecordIsNotSentAllOfThemAtOnce) {
  CreateDeviceRig("a");
  CreateDeviceRig("b");
  Begin();
  Report();
  PutEvents(600);  // more than go into one report
  Put(0);
  way_.last_taken = 1;
  EXPECT_EQ(Report().refusal, "");  // it may have lost records: begins anew
  EXPECT_GT(Report().waiting, 0);   // number 1, and there are more
  EXPECT_THAT(Report().refusal, HasSubstr("asks again for all records"));
  // It is tried again later, and later each time.
  int calls = way_.calls;
  for (const int wait_ms : {250, 500, 1000}) {
    now_ += std::chrono::milliseconds(wait_ms - 1);
    Report();
    EXPECT_EQ(way_.calls, calls) << wait_ms;
    now_ += std::chrono::milliseconds(1);
    Report();
    EXPECT_NE(Report().refusal, "");
    EXPECT_EQ(way_.calls, calls + 2) << wait_ms;
    calls = way_.calls;
  }
  // Others are reported meanwhile.
  Put(0, "b");
  way_.last_taken = std::numeric_limits<std::int64_t>::max();
  Report();
  EXPECT_EQ(SegmentsAtHub("b"), 1u);
  now_ += std::chrono::seconds(2);
  while (Report().waiting > 0) {
  }
  EXPECT_EQ(SegmentsAtHub("a"), 1u);
  EXPECT_EQ(Report().refusal, "");
}

TEST_F(ReporterTest, AnInstructionMustBeAboutItsRig) {
  CreateDeviceRig("a");
  CreateDeviceRig("b");
  Begin();
  Report();
  v1::CreateInstructionRequest request;
  request.set_parent("rigs/b");
  v1::Instruction given;
  EXPECT_TRUE(absl::IsInvalidArgument(CallHub(request, &given)));
  *request.mutable_instruction() = NewLabel("x");  // of a
  EXPECT_TRUE(absl::IsInvalidArgument(CallHub(request, &given)));
  // Of a rig that no device reports.
  EXPECT_TRUE(hub_.domain->CreateRig(TestRig("own")).ok());
  request.set_parent("rigs/own");
  request.mutable_instruction()->mutable_update_rig()->mutable_rig()->set_name(
      "rigs/own");
  EXPECT_TRUE(absl::IsFailedPrecondition(CallHub(request, &given)));
}

TEST_F(ReporterTest, ADeviceThatWasRestoredFollowsItsLaterAttempts) {
  CreateDeviceRig();
  Begin();
  for (int k = 0; k < 3; ++k) {
    Put(k);
    Report();
  }
  // It counts its attempts from 1 again.
  ASSERT_TRUE(device_.store->outbox()->Close().ok());
  Put(3);
  EXPECT_GT(Report().waiting, 0);
  EXPECT_EQ(Report().refusal, "");
  EXPECT_EQ(SegmentsAtHub(), 4u);
  EXPECT_EQ(device_.store->outbox()->List()->front().waiting, 0);
}

TEST_F(ReporterTest, ACallerOfALabelSeesNoEventsOfAnEarlierRig) {
  const auto create = [&](const std::string& site) {
    StoredRig rig{TestRig("a"), 0};
    rig.labels["site"] = site;
    return hub_.domain->CreateRig(rig).status();
  };
  ASSERT_TRUE(create("north").ok());
  ASSERT_TRUE(hub_.domain->DeleteRig("a", "eve", "sold").ok());
  ASSERT_TRUE(create("south").ok());
  const auto count = [&](const Grant& grant, const std::string& parent) {
    v1::ListEventsRequest request;
    request.set_parent(parent);
    v1::ListEventsResponse response;
    const absl::Status status =
        CallApi(*hub_.api, {"caller", {grant}}, request, &response);
    EXPECT_TRUE(status.ok()) << status;
    return response.events_size();
  };
  const Grant of_all = {Role::kRead, "", {}};
  const Grant of_south = {Role::kRead, "", std::pair("site", "south")};
  for (const char* parent : {"", "rigs/a"}) {
    EXPECT_EQ(count(of_all, parent), 5);
    EXPECT_EQ(count(of_south, parent), 2);
  }
}

TEST_F(ReporterTest, WatchersAtTheHubSeeWhatIsReported) {
  CreateDeviceRig();
  Begin();
  Report();
  std::vector<std::int64_t> versions;
  const auto watch = hub_.pipeline->WatchCalibration(
      "a", [&](const auto& active) { versions.push_back(active->version); });
  ASSERT_TRUE(watch.ok()) << watch.status();
  Put(0);
  ASSERT_TRUE(
      device_.domain
          ->CommitScore("a", {"s", 0}, FakeInformation(TestRig("a"), 1.0))
          .ok());
  const auto run = device_.domain->CreateManualRun("a", true);
  ASSERT_TRUE(run.ok()) << run.status();
  ASSERT_TRUE(device_.domain->BeginRun("a", run->run).ok());
  StoredCalibration result;
  result.state = CalibrationState::kActive;
  result.theta = TestRig("a").factory;
  const int size = TangentSize(result.theta);
  result.covariance = Eigen::MatrixXd::Identity(size, size);
  ASSERT_TRUE(device_.domain->FinishRun("a", run->run, result).ok());
  Report();
  EXPECT_THAT(versions, ::testing::ElementsAre(1, 2));
}

TEST_F(ReporterTest, WatchesAtTheHubEndWithAReportedDeletion) {
  CreateDeviceRig();
  Begin();
  Report();
  v1::WatchCalibrationRequest request;
  request.set_parent("rigs/a");
  Call call;
  call.caller = {"reader", {{Role::kRead, ""}}};
  const auto queue = std::make_shared<WatchQueue>();
  std::shared_ptr<void> watch;
  for (const Method& method : hub_.api->methods()) {
    if (method.descriptor->input_type() != request.GetDescriptor()) continue;
    auto begun = std::get<WatchHandler>(method.handler)(call, request, queue);
    ASSERT_TRUE(begun.ok()) << begun.status();
    watch = *std::move(begun);
  }
  EXPECT_TRUE(queue->Take().update);
  EXPECT_FALSE(queue->Take().ended);
  ASSERT_TRUE(device_.domain->DeleteRig("a", "me", "sold").ok());
  Report();
  EXPECT_TRUE(absl::IsNotFound(hub_.store->GetRig("a").status()));
  const WatchQueue::Taken end = queue->Take();
  EXPECT_TRUE(end.ended);
  EXPECT_TRUE(absl::IsNotFound(end.status)) << end.status;
}

}  // namespace
}  // namespace selfcal::server
