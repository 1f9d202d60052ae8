// selfcald as a process: alone on its folder, stopped, killed, started again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "test/server/daemon/daemon_fixture.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

TEST_F(DaemonTest, SecondDaemonOnTheSameFolderEndsAndTheFirstServesOn) {
  const auto first = StartAndWait();
  const auto second = Start({"--listen", "insecure:127.0.0.1:0"});
  EXPECT_EQ(second->Wait(), 1);
  EXPECT_THAT(second->Log(), HasSubstr("is in use by another selfcald"));
  EXPECT_THAT(second->Log(), HasSubstr(std::to_string(first->pid())));
  CreateRig();
}

TEST_F(DaemonTest, EndsWhenItsStateDirectoryIsRemoved) {
  const auto daemon = StartAndWait();
  CreateRig();
  std::filesystem::rename(state_, folder_ / "away");
  EXPECT_EQ(daemon->Wait(), 1);
  EXPECT_THAT(daemon->Log(), HasSubstr("was removed or replaced"));
  std::filesystem::rename(folder_ / "away", state_);
  const auto next = StartAndWait();
  EXPECT_EQ(Segments().segments_size(), 0);
}

TEST_F(DaemonTest, FolderIsForTheOwnerAndTheSocketForItsGroup) {
  const auto daemon = StartAndWait();
  for (const std::string name : {"", "lock", "selfcal.db"}) {
    struct stat status {};
    ASSERT_EQ(stat((state_ / name).c_str(), &status), 0) << name;
    EXPECT_EQ(status.st_mode & (S_IRWXG | S_IRWXO), 0u) << name;
  }
  struct stat status {};
  ASSERT_EQ(stat((state_ / "selfcald.sock").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0660u);
}

TEST_F(DaemonTest, StopsCleanlyOnEitherSignal) {
  for (const int signal : {SIGTERM, SIGINT}) {
    const auto daemon = StartAndWait();
    daemon->Signal(signal);
    EXPECT_EQ(daemon->Wait(), 0);
    EXPECT_THAT(daemon->Log(), HasSubstr("stopped"));
  }
}

TEST_F(DaemonTest, StopsCleanlyUnderAnOpenWatchAndAnIdleStream) {
  const auto daemon = StartAndWait();
  const Rig rig = CreateRig();
  grpc::ClientContext watch_context;
  v1::WatchCalibrationRequest request;
  request.set_parent("rigs/r");
  const auto calibrations = v1::CalibrationService::NewStub(channel_);
  const auto watch = calibrations->WatchCalibration(&watch_context, request);
  v1::Calibration active;
  ASSERT_TRUE(watch->Read(&active));
  grpc::ClientContext stream_context;
  const auto segments = v1::SegmentService::NewStub(channel_);
  const auto stream = segments->StreamSegments(&stream_context);
  v1::StreamSegmentsRequest sent;
  sent.set_parent("rigs/r");
  *sent.mutable_segment() = ToProto(TestSegments(rig, 1)[0]);
  ASSERT_TRUE(stream->Write(sent));
  v1::StreamSegmentsResponse verdict;
  ASSERT_TRUE(stream->Read(&verdict));
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
  EXPECT_FALSE(watch->Read(&active));
  EXPECT_EQ(watch->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  stream_context.TryCancel();
  stream->Finish();
}

TEST_F(DaemonTest, ScoresFillTablesAndSurviveAKill) {
  auto daemon = StartAndWait();
  const Rig rig = CreateRig();
  Stream(TestSegments(rig, 4));
  ASSERT_TRUE(AllScored());
  // The full tables start a run, which rescores their segments at its end.
  ASSERT_EQ(WatchToTheEnd("rigs/r/recalibrations/1").state(),
            v1::Recalibration::SUCCEEDED);
  const v1::ListTablesResponse tables = Tables();
  ASSERT_EQ(tables.tables_size(), static_cast<int>(rig.groups.size()));
  EXPECT_EQ(tables.tables(0).entries_size(), rig.table_size);
  daemon->Signal(SIGKILL);
  EXPECT_EQ(daemon->Wait(), -SIGKILL);
  daemon = StartAndWait();
  EXPECT_EQ(Tables().SerializeAsString(), tables.SerializeAsString());
  EXPECT_EQ(Segments().segments_size(), 4);
}

TEST_F(DaemonTest, RecalibrationRunsToItsEndBeforeItsWatcher) {
  const auto daemon = StartAndWait();
  const Rig rig = CreateRig();
  Stream(TestSegments(rig, 4));
  ASSERT_TRUE(AllScored());
  grpc::ClientContext context;
  v1::StartRecalibrationRequest request;
  request.set_parent("rigs/r");
  v1::Recalibration run;
  const auto stub = v1::RecalibrationService::NewStub(channel_);
  // The trigger may have been faster; both ways the first run exists.
  const auto started = stub->StartRecalibration(&context, request, &run);
  EXPECT_TRUE(started.ok() ||
              started.error_code() == grpc::StatusCode::FAILED_PRECONDITION)
      << started.error_message();
  run = WatchToTheEnd("rigs/r/recalibrations/1");
  EXPECT_EQ(run.state(), v1::Recalibration::SUCCEEDED) << run.message();
  EXPECT_EQ(run.calibration(), "rigs/r/calibrations/2");
  EXPECT_GT(run.solver().iterations(), 0);
}

TEST_F(DaemonTest, ASecondImuComesOverTheWireIntoAVersion) {
  const auto daemon = StartAndWait();
  Rig rig = TestRig("r");
  AddSecondImu(&rig);
  CreateRig(rig);
  Stream(TestSegments(rig, 4));
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(WatchToTheEnd("rigs/r/recalibrations/1").state(),
            v1::Recalibration::SUCCEEDED);
  grpc::ClientContext context;
  v1::GetCalibrationRequest request;
  request.set_name("rigs/r/calibrations/2");
  v1::Calibration version;
  ASSERT_TRUE(v1::CalibrationService::NewStub(channel_)
                  ->GetCalibration(&context, request, &version)
                  .ok());
  EXPECT_TRUE(version.parameters().imu1().has_q_ji());
  const auto& estimates = version.estimates();
  EXPECT_EQ(std::count_if(estimates.begin(),
                          estimates.end(),
                          [](const v1::ComponentEstimate& estimate) {
                            return estimate.component().starts_with("imu1.");
                          }),
            22);
  v1::GetSegmentResidualsRequest of_segment;
  of_segment.set_name("rigs/r/segments/s~0");
  grpc::ClientContext residuals_context;
  v1::SegmentResiduals residuals;
  const grpc::Status read =
      v1::SegmentService::NewStub(channel_)->GetSegmentResiduals(
          &residuals_context, of_segment, &residuals);
  ASSERT_TRUE(read.ok()) << read.error_message();
  EXPECT_GT(residuals.intervals().whitened_size(), 0);
  EXPECT_EQ(residuals.imu1_intervals().whitened_size(),
            residuals.intervals().whitened_size());
  EXPECT_EQ(residuals.imu1_inertial_rms_size(), 5);
}

// Scores by Ceres in the daemon; the checks in processes of their own.
TEST_F(DaemonTest, BothCoresAgreeOnWhatItHasComputed) {
  const auto daemon =
      StartAndWait({"--scorer", "ceres", "--run-priority", "low"});
  CreateRig();
  Stream(TestSegments(TestRig("r"), 4));
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(WatchToTheEnd("rigs/r/recalibrations/1").state(),
            v1::Recalibration::SUCCEEDED);
  grpc::ClientContext context;
  v1::VerifyRigRequest request;
  request.set_parent("rigs/r");
  const auto stub = v1::CalibrationService::NewStub(channel_);
  const auto reader = stub->VerifyRig(&context, request);
  v1::VerifyRigResponse response;
  while (reader->Read(&response)) {
    if (response.has_score()) {
      EXPECT_EQ(response.score().outcome(), v1::VerifyRigResponse::AGREES)
          << response.ShortDebugString();
    }
  }
  const auto status = reader->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  ASSERT_TRUE(response.has_summary());
  EXPECT_GE(response.summary().scores(), 2);
  EXPECT_EQ(response.summary().finding(), "");
}

TEST_F(DaemonTest, WhatCannotStartSaysWhy) {
  std::ofstream(state_) << "a file, no folder";
  const auto no_folder = Start();
  EXPECT_EQ(no_folder->Wait(), 1);
  EXPECT_THAT(no_folder->Log(), HasSubstr("cannot create the folder"));
  std::filesystem::remove(state_);

  std::filesystem::create_directory(state_);
  std::ofstream(state_ / "selfcal.db") << "this is no database at all";
  const auto no_database = Start();
  EXPECT_EQ(no_database->Wait(), 1);
  EXPECT_THAT(no_database->Log(), HasSubstr("cannot open"));
  std::filesystem::remove(state_ / "selfcal.db");

  const auto no_address = Start({"--listen", "unix:/no/such/folder/socket"});
  EXPECT_EQ(no_address->Wait(), 1);
  EXPECT_THAT(no_address->Log(), HasSubstr("cannot listen on"));
}

}  // namespace
}  // namespace selfcal::server
