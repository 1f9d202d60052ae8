#include "test/server/grpc/service_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class RecalibrationServiceTest : public ServiceTest {
 protected:
  grpc::Status Start(const std::string& parent,
                     v1::Recalibration* run,
                     bool force = false) {
    Context context;
    v1::StartRecalibrationRequest request;
    request.set_parent(parent);
    request.set_force(force);
    return recalibrations_->StartRecalibration(&context, request, run);
  }

  grpc::Status Get(const std::string& name, v1::Recalibration* run) {
    Context context;
    v1::GetRecalibrationRequest request;
    request.set_name(name);
    return recalibrations_->GetRecalibration(&context, request, run);
  }

  grpc::Status Cancel(const std::string& name, v1::Recalibration* run) {
    Context context;
    v1::CancelRecalibrationRequest request;
    request.set_name(name);
    return recalibrations_->CancelRecalibration(&context, request, run);
  }

  grpc::Status List(const std::string& parent,
                    int size,
                    const std::string& token,
                    v1::ListRecalibrationsResponse* response) {
    Context context;
    v1::ListRecalibrationsRequest request;
    request.set_parent(parent);
    request.set_page_size(size);
    request.set_page_token(token);
    return recalibrations_->ListRecalibrations(&context, request, response);
  }

  std::unique_ptr<grpc::ClientReader<v1::Recalibration>> Watch(
      Context* context, const std::string& name) {
    v1::WatchRecalibrationRequest request;
    request.set_name(name);
    return recalibrations_->WatchRecalibration(context, request);
  }
};

TEST_F(RecalibrationServiceTest, StartedRunHoldsTheSegmentsOfTheTables) {
  AddScored(1);
  v1::Recalibration run;
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  EXPECT_EQ(run.name(), "rigs/r/recalibrations/1");
  EXPECT_EQ(run.state(), v1::Recalibration::PENDING);
  EXPECT_EQ(run.trigger(), v1::Recalibration::MANUAL);
  EXPECT_THAT(run.segments(), ElementsAre("rigs/r/segments/s~0"));
  EXPECT_FALSE(run.has_end_time());
}

TEST_F(RecalibrationServiceTest, WhatCannotStartSaysSo) {
  v1::Recalibration run;
  EXPECT_THAT(BadFields(Start("r", &run)), ElementsAre("parent"));
  ExpectNotFound(Start("rigs/r", &run), "rigs/r");
  AddRig("empty");
  EXPECT_EQ(Start("rigs/empty", &run).error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
  AddScored(1);
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  EXPECT_EQ(Start("rigs/r", &run).error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
}

TEST_F(RecalibrationServiceTest, SucceededRunNamesItsCalibrationAndReport) {
  const Rig rig = AddScored(1);
  v1::Recalibration run;
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  FinishRun(rig, 1);
  ASSERT_TRUE(Get("rigs/r/recalibrations/1", &run).ok());
  EXPECT_EQ(run.state(), v1::Recalibration::SUCCEEDED);
  EXPECT_EQ(run.calibration(), "rigs/r/calibrations/2");
  EXPECT_EQ(run.solver().status(), "converged");
  EXPECT_EQ(run.solver().iterations(), 7);
  EXPECT_EQ(run.attempts(), 1);
  EXPECT_TRUE(run.has_end_time());
}

TEST_F(RecalibrationServiceTest, RunThatDoesNotExistIsNotFound) {
  AddRig();
  v1::Recalibration run;
  const std::string name = "rigs/r/recalibrations/1";
  ExpectNotFound(Get(name, &run), name);
  ExpectNotFound(Cancel(name, &run), name);
  Context context;
  ExpectNotFound(Watch(&context, name)->Finish(), name);
}

TEST_F(RecalibrationServiceTest, WhatIsNoNameIsRefused) {
  v1::Recalibration run;
  for (const std::string name : {"", "rigs/r/recalibrations/x"}) {
    EXPECT_THAT(BadFields(Get(name, &run)), ElementsAre("name"));
    EXPECT_THAT(BadFields(Cancel(name, &run)), ElementsAre("name"));
    Context context;
    EXPECT_THAT(BadFields(Watch(&context, name)->Finish()),
                ElementsAre("name"));
  }
}

TEST_F(RecalibrationServiceTest, PagesHoldEveryRunNewestFirst) {
  const Rig rig = AddScored(1);
  v1::Recalibration run;
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  FinishRun(rig, 1);
  ASSERT_TRUE(Start("rigs/r", &run, true).ok());
  v1::ListRecalibrationsResponse page;
  ASSERT_TRUE(List("rigs/r", 1, "", &page).ok());
  ASSERT_EQ(page.recalibrations_size(), 1);
  EXPECT_EQ(page.recalibrations(0).name(), "rigs/r/recalibrations/2");
  const std::string token = page.next_page_token();
  ASSERT_TRUE(List("rigs/r", 1, token, &page).ok());
  ASSERT_EQ(page.recalibrations_size(), 1);
  EXPECT_EQ(page.recalibrations(0).name(), "rigs/r/recalibrations/1");
  EXPECT_EQ(page.recalibrations(0).solver().iterations(), 7);
}

TEST_F(RecalibrationServiceTest, RunsAreFilteredAndSorted) {
  const Rig rig = AddScored(1);
  v1::Recalibration run;
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  FinishRun(rig, 1);
  ASSERT_TRUE(Start("rigs/r", &run, true).ok());
  const auto list = [&](const std::string& filter, const std::string& order) {
    Context context;
    v1::ListRecalibrationsRequest request;
    request.set_filter(filter);
    request.set_order_by(order);
    v1::ListRecalibrationsResponse page;
    const grpc::Status status =
        recalibrations_->ListRecalibrations(&context, request, &page);
    EXPECT_TRUE(status.ok()) << status.error_message();
    std::vector<std::string> names;
    for (const auto& one : page.recalibrations()) names.push_back(one.name());
    return names;
  };
  EXPECT_THAT(list("state = PENDING", ""),
              ElementsAre("rigs/r/recalibrations/2"));
  EXPECT_THAT(list("state = SUCCEEDED AND trigger = MANUAL", ""),
              ElementsAre("rigs/r/recalibrations/1"));
  EXPECT_THAT(list("trigger = TABLES_FULL", ""), ElementsAre());
  EXPECT_THAT(
      list("", "create_time asc"),
      ElementsAre("rigs/r/recalibrations/1", "rigs/r/recalibrations/2"));
  EXPECT_THAT(list("", "duration"), ElementsAre("rigs/r/recalibrations/1"));
  v1::ListRecalibrationsRequest request;
  v1::ListRecalibrationsResponse page;
  request.set_filter("state = pending");
  Context first;
  EXPECT_THAT(
      BadFields(recalibrations_->ListRecalibrations(&first, request, &page)),
      ElementsAre("filter"));
  request.clear_filter();
  request.set_order_by("state");
  Context second;
  EXPECT_THAT(
      BadFields(recalibrations_->ListRecalibrations(&second, request, &page)),
      ElementsAre("order_by"));
}

TEST_F(RecalibrationServiceTest, UnchangedTablesHaveToBeForced) {
  const Rig rig = AddScored(1);
  v1::Recalibration run;
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  FinishRun(rig, 1);
  const grpc::Status refused = Start("rigs/r", &run);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(refused.error_message(), ::testing::HasSubstr("version 2"));
  EXPECT_TRUE(Start("rigs/r", &run, true).ok());
}

TEST_F(RecalibrationServiceTest, ListOfAnUnknownRigOrPageIsRefused) {
  v1::ListRecalibrationsResponse page;
  EXPECT_THAT(BadFields(List("x", 0, "", &page)), ElementsAre("parent"));
  ExpectNotFound(List("rigs/r", 0, "", &page), "rigs/r");
  AddRig();
  EXPECT_THAT(BadFields(List("rigs/r", -1, "", &page)),
              ElementsAre("page_size"));
  EXPECT_THAT(BadFields(List("rigs/r", 1, "x", &page)),
              ElementsAre("page_token"));
}

TEST_F(RecalibrationServiceTest, WatchShowsProgressAndEndsWithTheRun) {
  const Rig rig = AddScored(1);
  v1::Recalibration run;
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  Context context;
  const auto reader = Watch(&context, run.name());
  ASSERT_TRUE(reader->Read(&run));
  EXPECT_EQ(run.state(), v1::Recalibration::PENDING);

  StoredRun running = *store_->GetRun("r", 1);
  running.state = RunState::kRunning;
  pipeline_->Tell({running, {3, 100, 12.5, 0.25}});
  ASSERT_TRUE(reader->Read(&run));
  EXPECT_EQ(run.state(), v1::Recalibration::RUNNING);
  EXPECT_EQ(run.iteration(), 3);
  EXPECT_EQ(run.max_iterations(), 100);
  EXPECT_EQ(run.cost(), 12.5);
  EXPECT_EQ(run.step_sigmas(), 0.25);

  FinishRun(rig, 1);
  pipeline_->Tell({*store_->GetRun("r", 1), {}});
  ASSERT_TRUE(reader->Read(&run));
  EXPECT_EQ(run.state(), v1::Recalibration::SUCCEEDED);
  EXPECT_EQ(run.solver().iterations(), 7);
  EXPECT_FALSE(reader->Read(&run));
  EXPECT_TRUE(reader->Finish().ok());
}

TEST_F(RecalibrationServiceTest, WatchOfAnEndedRunShowsItOnce) {
  const Rig rig = AddScored(1);
  v1::Recalibration run;
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  FinishRun(rig, 1);
  Context context;
  const auto reader = Watch(&context, "rigs/r/recalibrations/1");
  ASSERT_TRUE(reader->Read(&run));
  EXPECT_EQ(run.state(), v1::Recalibration::SUCCEEDED);
  EXPECT_FALSE(reader->Read(&run));
  EXPECT_TRUE(reader->Finish().ok());
}

TEST_F(RecalibrationServiceTest, CancelledRunIsOverForItsWatcherToo) {
  AddScored(1);
  v1::Recalibration run;
  ASSERT_TRUE(Start("rigs/r", &run).ok());
  ASSERT_TRUE(domain_->BeginRun("r", 1).ok());
  Context context;
  const auto reader = Watch(&context, run.name());
  v1::Recalibration seen;
  ASSERT_TRUE(reader->Read(&seen));
  ASSERT_TRUE(Cancel(run.name(), &run).ok());
  EXPECT_EQ(run.state(), v1::Recalibration::CANCELLED);
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.state(), v1::Recalibration::CANCELLED);
  EXPECT_FALSE(reader->Read(&seen));
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_EQ(Cancel(run.name(), &run).error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
}

}  // namespace
}  // namespace selfcal::server
