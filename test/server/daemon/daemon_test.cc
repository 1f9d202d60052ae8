// selfcald as a process: alone on its folder, stopped, killed, started again.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>

#include "proto/convert.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/server/daemon/process.h"
#include "test/server/test_segments.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class DaemonTest : public ::testing::Test {
 protected:
  DaemonTest() {
    std::string folder = std::filesystem::temp_directory_path() / "scd-XXXXXX";
    folder_ = mkdtemp(folder.data());
    state_ = folder_ / "state";
  }
  ~DaemonTest() override { std::filesystem::remove_all(folder_); }

  std::unique_ptr<Process> Start(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {
        SELFCALD_PATH, "--state-dir", state_.string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const std::string log = "log" + std::to_string(++processes_);
    return std::make_unique<Process>(arguments, folder_ / log);
  }

  std::unique_ptr<Process> StartAndWait() {
    auto daemon = Start();
    EXPECT_TRUE(daemon->Says("selfcald ready: listening on unix:"))
        << daemon->Log();
    // A channel of its own for each process: no backoff from the one before.
    grpc::ChannelArguments arguments;
    arguments.SetInt("test.generation", processes_);
    channel_ =
        grpc::CreateCustomChannel("unix:" + (state_ / "selfcald.sock").string(),
                                  grpc::InsecureChannelCredentials(),
                                  arguments);
    return daemon;
  }

  Rig CreateRig() {
    const Rig rig = TestRig("r");
    grpc::ClientContext context;
    v1::CreateRigRequest request;
    *request.mutable_rig() = ToProto(rig);
    v1::Rig created;
    const auto stub = v1::RigService::NewStub(channel_);
    const auto status = stub->CreateRig(&context, request, &created);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return rig;
  }

  void Stream(const std::vector<MotionSegment>& segments) {
    grpc::ClientContext context;
    const auto stub = v1::SegmentService::NewStub(channel_);
    const auto stream = stub->StreamSegments(&context);
    for (const MotionSegment& segment : segments) {
      v1::StreamSegmentsRequest request;
      request.set_parent("rigs/r");
      *request.mutable_segment() = ToProto(segment);
      ASSERT_TRUE(stream->Write(request));
      v1::StreamSegmentsResponse response;
      ASSERT_TRUE(stream->Read(&response));
      ASSERT_EQ(response.verdict(), v1::StreamSegmentsResponse::STORED);
    }
    stream->WritesDone();
    EXPECT_TRUE(stream->Finish().ok());
  }

  v1::ListSegmentsResponse Segments() {
    grpc::ClientContext context;
    v1::ListSegmentsRequest request;
    request.set_parent("rigs/r");
    v1::ListSegmentsResponse response;
    const auto stub = v1::SegmentService::NewStub(channel_);
    EXPECT_TRUE(stub->ListSegments(&context, request, &response).ok());
    return response;
  }

  v1::ListTablesResponse Tables() {
    grpc::ClientContext context;
    v1::ListTablesRequest request;
    request.set_parent("rigs/r");
    v1::ListTablesResponse response;
    const auto stub = v1::SegmentService::NewStub(channel_);
    EXPECT_TRUE(stub->ListTables(&context, request, &response).ok());
    return response;
  }

  // Waits until every segment is scored.
  bool AllScored() {
    for (int i = 0; i < 600; ++i) {
      const v1::ListSegmentsResponse listed = Segments();
      const auto& segments = listed.segments();
      if (std::all_of(segments.begin(), segments.end(), [](const auto& s) {
            return s.state() == v1::Segment::SCORED;
          })) {
        return true;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    return false;
  }

  // The last update of the run, when its watch has ended.
  v1::Recalibration WatchToTheEnd(const std::string& name) {
    grpc::ClientContext context;
    v1::WatchRecalibrationRequest request;
    request.set_name(name);
    const auto stub = v1::RecalibrationService::NewStub(channel_);
    const auto reader = stub->WatchRecalibration(&context, request);
    v1::Recalibration run;
    while (reader->Read(&run)) {
    }
    EXPECT_TRUE(reader->Finish().ok());
    return run;
  }

  std::filesystem::path folder_;
  std::filesystem::path state_;
  std::shared_ptr<grpc::Channel> channel_;

 private:
  int processes_ = 0;
};

TEST_F(DaemonTest, SecondDaemonOnTheSameFolderEndsAndTheFirstServesOn) {
  const auto first = StartAndWait();
  const auto second = Start({"--listen", "127.0.0.1:0"});
  EXPECT_EQ(second->Wait(), 1);
  EXPECT_THAT(second->Log(), HasSubstr("is in use by another selfcald"));
  EXPECT_THAT(second->Log(), HasSubstr(std::to_string(first->pid())));
  CreateRig();
}

TEST_F(DaemonTest, FolderAndSocketAreForTheOwnerAlone) {
  const auto daemon = StartAndWait();
  for (const std::string name : {"", "lock", "selfcal.db", "selfcald.sock"}) {
    struct stat status {};
    ASSERT_EQ(stat((state_ / name).c_str(), &status), 0) << name;
    EXPECT_EQ(status.st_mode & (S_IRWXG | S_IRWXO), 0u) << name;
  }
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
