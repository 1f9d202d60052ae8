// selfcald as a process on a folder of its own, and a client of it.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "proto/convert.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/server/daemon/process.h"
#include "test/server/test_segments.h"
#include "test/support/certificates.h"
#include "test/support/eventually.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {

class DaemonTest : public ::testing::Test {
 protected:
  std::unique_ptr<Process> Start(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {
        SELFCALD_PATH, "--state-dir", state_.string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const std::string log = "log" + std::to_string(++processes_);
    return std::make_unique<Process>(arguments, folder_ / log);
  }

  std::unique_ptr<Process> StartAndWait(std::vector<std::string> more = {}) {
    auto daemon = Start(std::move(more));
    EXPECT_TRUE(daemon->Says("selfcald ready: listening on unix:"))
        << daemon->Log();
    Connect();
    return daemon;
  }

  // The same with a socket, for the fixture's client, and with TLS.
  std::unique_ptr<Process> StartWithTls(const Certificates& certificates,
                                        std::vector<std::string> more = {}) {
    more.insert(more.end(),
                {"--listen", "unix:" + (state_ / "selfcald.sock").string()});
    const auto tls = certificates.DaemonArguments();
    more.insert(more.end(), tls.begin(), tls.end());
    return StartAndWait(std::move(more));
  }

  // A channel of its own for each start: no backoff from the one before.
  void Connect() {
    grpc::ChannelArguments arguments;
    arguments.SetInt("test.generation", ++channels_);
    channel_ =
        grpc::CreateCustomChannel("unix:" + (state_ / "selfcald.sock").string(),
                                  grpc::InsecureChannelCredentials(),
                                  arguments);
  }

  Rig CreateRig(const Rig& rig = TestRig("r")) {
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
    request.set_page_size(1000);
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
    return Eventually(
        [this] {
          const v1::ListSegmentsResponse listed = Segments();
          const auto& segments = listed.segments();
          return std::all_of(
              segments.begin(), segments.end(), [](const auto& s) {
                return s.state() == v1::Segment::SCORED;
              });
        },
        kLongWait,
        kDaemonInterval);
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

  const TempFolder temp_folder_;
  const std::filesystem::path folder_ = temp_folder_.path();
  const std::filesystem::path state_ = folder_ / "state";
  std::shared_ptr<grpc::Channel> channel_;

 private:
  int processes_ = 0;
  int channels_ = 0;
};

}  // namespace selfcal::server
