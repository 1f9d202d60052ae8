#include <memory>
#include <string>
#include <vector>

#include "selfcal/v1/activity_service.grpc.pb.h"
#include "test/server/grpc/service_test.h"

namespace selfcal::server {
namespace {

class ActivityServiceTest : public ServiceTest {
 protected:
  ActivityServiceTest() : stub_(v1::ActivityService::NewStub(channel_)) {}

  v1::ListActivityResponse List(int page_size = 0,
                                const std::string& token = "") {
    Context context;
    v1::ListActivityRequest request;
    request.set_page_size(page_size);
    request.set_page_token(token);
    v1::ListActivityResponse response;
    const auto status = stub_->ListActivity(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }

  // Sends a segment to the rig and reads the verdict.
  using Stream =
      std::unique_ptr<grpc::ClientReaderWriter<v1::StreamSegmentsRequest,
                                               v1::StreamSegmentsResponse>>;
  static v1::StreamSegmentsResponse Send(const Stream& stream,
                                         const Rig& rig,
                                         const MotionSegment& segment) {
    v1::StreamSegmentsRequest request;
    request.set_parent(RigName(rig.id));
    *request.mutable_segment() = ToProto(segment);
    v1::StreamSegmentsResponse response;
    EXPECT_TRUE(stream->Write(request));
    EXPECT_TRUE(stream->Read(&response));
    return response;
  }

  std::unique_ptr<v1::ActivityService::Stub> stub_;
};

TEST_F(ActivityServiceTest, ARigThatSentLastComesFirst) {
  const Rig a = AddRig("a");
  const Rig b = AddRig("b");
  AddRig("c");
  ASSERT_TRUE(domain_->PutSegment("b", TestSegments(b, 1)[0]).ok());
  ASSERT_TRUE(domain_->PutSegment("a", TestSegments(a, 1)[0]).ok());
  const auto first = List(2);
  ASSERT_EQ(first.rigs_size(), 2);
  EXPECT_EQ(first.rigs(0).name(), "rigs/a");
  EXPECT_EQ(first.rigs(1).name(), "rigs/b");
  EXPECT_TRUE(first.rigs(0).has_last_seen());
  EXPECT_GE(first.time().seconds(), first.rigs(0).last_seen().seconds());
  EXPECT_GE(first.time().seconds(), first.start_time().seconds());
  const auto second = List(2, first.next_page_token());
  ASSERT_EQ(second.rigs_size(), 1);
  EXPECT_EQ(second.rigs(0).name(), "rigs/c");
  EXPECT_FALSE(second.rigs(0).has_last_seen());
  EXPECT_EQ(second.next_page_token(), "");
}

TEST_F(ActivityServiceTest, TellsVersionAndTables) {
  const Rig rig = AddScored(3);
  const auto listed = List();
  ASSERT_EQ(listed.rigs_size(), 1);
  EXPECT_EQ(listed.rigs(0).active_version(), 1);
  EXPECT_GT(listed.rigs(0).active_since().seconds(), 0);
  int entries = 0;
  int capacity = 0;
  const auto tables = store_->GetTables(rig.id);
  ASSERT_TRUE(tables.ok());
  for (const Table& table : *tables) {
    entries += static_cast<int>(table.entries.size());
    capacity += static_cast<int>(table.capacity);
  }
  EXPECT_GT(entries, 0);
  EXPECT_EQ(listed.rigs(0).table_entries(), entries);
  EXPECT_EQ(listed.rigs(0).table_capacity(), capacity);
}

TEST_F(ActivityServiceTest, CountsStreamsAndVerdicts) {
  const Rig rig = AddRig();
  AddRig("idle");
  const auto segments = TestSegments(rig, 2);
  Context context;
  const Stream stream = segments_->StreamSegments(&context);
  EXPECT_EQ(Send(stream, rig, segments[0]).verdict(),
            v1::StreamSegmentsResponse::STORED);
  Send(stream, rig, segments[0]);  // known already
  MotionSegment bad = segments[1];
  bad.imu.clear();
  EXPECT_EQ(Send(stream, rig, bad).verdict(),
            v1::StreamSegmentsResponse::REJECTED);
  const auto open = List();
  ASSERT_EQ(open.rigs_size(), 2);
  for (const v1::SegmentTraffic& traffic :
       {open.rigs(0).traffic(), open.traffic()}) {
    EXPECT_EQ(traffic.streams(), 1);
    EXPECT_EQ(traffic.stored(), 1);
    EXPECT_EQ(traffic.rejected(), 1);
    EXPECT_GT(traffic.stored_per_minute(), 0.2);
    EXPECT_LE(traffic.stored_per_minute(), 1);
  }
  EXPECT_EQ(open.rigs(1).traffic().streams(), 0);
  EXPECT_EQ(open.rigs(1).traffic().stored(), 0);
  stream->WritesDone();
  EXPECT_TRUE(stream->Finish().ok());
  EXPECT_TRUE(Eventually([&] { return List().traffic().streams() == 0; }));
  EXPECT_EQ(List().rigs(0).traffic().streams(), 0);
}

TEST_F(ActivityServiceTest, TellsARunUntilItHasEnded) {
  const Rig rig = AddScored(1);
  EXPECT_FALSE(List().rigs(0).has_run());
  const auto run = domain_->CreateManualRun(rig.id);
  ASSERT_TRUE(run.ok()) << run.status();
  pipeline_->progress.iteration = 4;
  pipeline_->progress.max_iterations = 100;
  const auto listed = List();
  ASSERT_TRUE(listed.rigs(0).has_run());
  EXPECT_EQ(listed.rigs(0).run().iteration(), 4);
  EXPECT_EQ(listed.rigs(0).run().max_iterations(), 100);
  EXPECT_EQ(listed.rigs(0).run().name(), "rigs/r/recalibrations/1");
  EXPECT_EQ(listed.rigs(0).run().state(), v1::Recalibration::PENDING);
  FinishRun(rig, 1);
  EXPECT_FALSE(List().rigs(0).has_run());
  EXPECT_EQ(List().rigs(0).active_version(), 2);
}

TEST_F(ActivityServiceTest, RefusesAPageThatIsNone) {
  Context context;
  v1::ListActivityRequest request;
  request.set_page_size(-1);
  v1::ListActivityResponse response;
  EXPECT_EQ(BadFields(stub_->ListActivity(&context, request, &response)),
            std::vector<std::string>{"page_size"});
}

}  // namespace
}  // namespace selfcal::server
