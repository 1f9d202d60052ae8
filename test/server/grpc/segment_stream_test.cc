#include <limits>
#include <mutex>
#include <thread>
#include <vector>

#include "server/grpc/calls.h"
#include "test/server/grpc/service_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::StartsWith;
using Response = v1::StreamSegmentsResponse;

// One StreamSegments call.
class Stream {
 public:
  explicit Stream(v1::SegmentService::Stub* stub)
      : stream_(stub->StreamSegments(&context_)) {}

  // The verdict on one message; unspecified if the stream has ended.
  Response Send(const v1::StreamSegmentsRequest& request) {
    Response response;
    if (stream_->Write(request)) stream_->Read(&response);
    return response;
  }
  Response Send(const MotionSegment& segment,
                const std::string& parent = "rigs/r") {
    v1::StreamSegmentsRequest request;
    request.set_parent(parent);
    *request.mutable_segment() = ToProto(segment);
    return Send(request);
  }

  void Write(const MotionSegment& segment) {
    v1::StreamSegmentsRequest request;
    request.set_parent("rigs/r");
    *request.mutable_segment() = ToProto(segment);
    stream_->Write(request);
  }

  Response Read() {
    Response response;
    stream_->Read(&response);
    return response;
  }

  grpc::Status Finish() {
    stream_->WritesDone();
    return stream_->Finish();
  }
  grpc::ClientContext& context() { return context_; }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamSegmentsRequest, Response>>
      stream_;
};

std::vector<std::string> Fields(const Response& response) {
  EXPECT_EQ(response.verdict(), Response::REJECTED);
  std::vector<std::string> fields;
  for (const auto& violation : response.violations()) {
    EXPECT_FALSE(violation.description().empty());
    fields.push_back(violation.field());
  }
  return fields;
}

using SegmentStreamTest = ServiceTest;

TEST_F(SegmentStreamTest, EverySegmentIsAnsweredInOrderAndStored) {
  const Rig rig = AddRig();
  const auto segments = TestSegments(rig, 3);
  Stream stream(segments_.get());
  for (const MotionSegment& segment : segments) {
    const Response response = stream.Send(segment);
    EXPECT_EQ(response.verdict(), Response::STORED);
    EXPECT_EQ(response.session(), segment.key.session);
    EXPECT_EQ(response.index(), segment.key.index);
    EXPECT_TRUE(store_->GetSegment("r", segment.key).ok());
  }
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, StatesHowManyObservationsWereLeftOut) {
  const Rig rig = AddRig();
  Stream stream(segments_.get());
  pipeline_->submit_hook = [](const auto&) {
    return SubmitResult{SubmitResult::Verdict::kStored, {}, 6};
  };
  EXPECT_EQ(stream.Send(TestSegments(rig, 1)[0]).observations_dropped(), 6);
}

TEST_F(SegmentStreamTest, ItsEndIsTheEndOfASessionIfItStoredAnything) {
  const Rig rig = AddRig();
  const MotionSegment segment = TestSegments(rig, 1)[0];
  const auto ended = [&](const std::string& last) {
    EXPECT_TRUE(Eventually([&] {
      const std::vector<std::string> rigs = pipeline_->ended();
      return !rigs.empty() && rigs.back() == last;
    }));
    return pipeline_->ended();
  };
  {
    Stream stream(segments_.get());
    stream.Send(segment);
    EXPECT_TRUE(pipeline_->ended().empty());
    EXPECT_TRUE(stream.Finish().ok());
  }
  EXPECT_THAT(ended("r"), ::testing::ElementsAre("r"));
  {
    Stream stream(segments_.get());
    EXPECT_EQ(stream.Send(segment).verdict(), Response::DUPLICATE);
    EXPECT_TRUE(stream.Finish().ok());
  }
  {
    AddRig("next");
    Stream stream(segments_.get());
    EXPECT_EQ(stream.Send(segment, "rigs/next").verdict(), Response::STORED);
    EXPECT_TRUE(stream.Finish().ok());
  }
  EXPECT_THAT(ended("next"), ::testing::ElementsAre("r", "next"));
}

TEST_F(SegmentStreamTest, SecondTimeIsADuplicate) {
  const auto segments = TestSegments(AddRig(), 1);
  Stream stream(segments_.get());
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::STORED);
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::DUPLICATE);
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, MalformedSegmentIsRejectedAndTheStreamGoesOn) {
  const auto segments = TestSegments(AddRig(), 2);
  Stream stream(segments_.get());
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::STORED);

  MotionSegment bad = segments[1];
  bad.keyframes[3].q_GI.w() += 1;
  bad.observations[2].z_px.x() = std::numeric_limits<double>::quiet_NaN();
  bad.observations[4].landmark = 1'000'000;
  std::swap(bad.imu[5], bad.imu[6]);
  const Response rejected = stream.Send(bad);
  EXPECT_EQ(rejected.session(), bad.key.session);
  EXPECT_EQ(rejected.index(), bad.key.index);
  const auto fields = Fields(rejected);
  EXPECT_THAT(fields, Contains("keyframes[3].q_gi"));
  EXPECT_THAT(fields, Contains("observations[2].z_px"));
  EXPECT_THAT(fields, Contains("observations[4].landmark"));
  EXPECT_THAT(fields, Contains(StartsWith("imu[6].t_ns")));

  EXPECT_EQ(stream.Send(segments[1]).verdict(), Response::STORED);
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, TemperatureIsStoredAndShownIfItIsPossible) {
  auto segments = TestSegments(AddRig(), 3);
  Stream stream(segments_.get());
  segments[0].temperature_c = 41.5;
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::STORED);
  segments[1].temperature_c = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Fields(stream.Send(segments[1])), ElementsAre("temperature_c"));
  segments[1].temperature_c = 200.1;
  EXPECT_THAT(Fields(stream.Send(segments[1])), ElementsAre("temperature_c"));
  EXPECT_EQ(stream.Send(segments[2]).verdict(), Response::STORED);
  EXPECT_TRUE(stream.Finish().ok());

  Context context;
  v1::ListSegmentsRequest request;
  request.set_parent("rigs/r");
  v1::ListSegmentsResponse listed;
  ASSERT_TRUE(segments_->ListSegments(&context, request, &listed).ok());
  ASSERT_EQ(listed.segments_size(), 2);
  EXPECT_FALSE(listed.segments(0).has_temperature_c());
  EXPECT_EQ(listed.segments(1).temperature_c(), 41.5);
}

TEST_F(SegmentStreamTest, MotionIsShown) {
  const auto segments = TestSegments(AddRig(), 1);
  Stream stream(segments_.get());
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::STORED);
  EXPECT_TRUE(stream.Finish().ok());

  Context context;
  v1::ListSegmentsRequest request;
  request.set_parent("rigs/r");
  v1::ListSegmentsResponse listed;
  ASSERT_TRUE(segments_->ListSegments(&context, request, &listed).ok());
  ASSERT_EQ(listed.segments_size(), 1);
  ASSERT_TRUE(listed.segments(0).has_motion());
  const MotionStatistics expected = MotionStatisticsOf(segments[0]);
  const v1::Segment::Motion& motion = listed.segments(0).motion();
  EXPECT_EQ(motion.angular_rate(), expected.angular_rate_radps);
  EXPECT_EQ(motion.acceleration(), expected.acceleration_mps2);
}

TEST_F(SegmentStreamTest, WrongShapeIsRejectedAndTheStreamGoesOn) {
  const auto segments = TestSegments(AddRig(), 1);
  Stream stream(segments_.get());
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/r");
  EXPECT_THAT(Fields(stream.Send(request)), ElementsAre("keyframes", "imu"));
  *request.mutable_segment() = ToProto(segments[0]);
  request.mutable_segment()
      ->mutable_observations()
      ->mutable_z_px()
      ->RemoveLast();
  EXPECT_THAT(Fields(stream.Send(request)), ElementsAre("observations.z_px"));
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::STORED);
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, HugeSessionIsRejectedWithoutBeingEchoedWhole) {
  auto segments = TestSegments(AddRig(), 1);
  segments[0].key.session = std::string(8 << 20, 'x');
  Stream stream(segments_.get());
  const Response response = stream.Send(segments[0]);
  EXPECT_THAT(Fields(response), ElementsAre("session"));
  EXPECT_LT(response.ByteSizeLong(), 10'000u);
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, LaterMessagesMayLeaveOutTheRig) {
  const auto segments = TestSegments(AddRig(), 2);
  Stream stream(segments_.get());
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::STORED);
  EXPECT_EQ(stream.Send(segments[1], "").verdict(), Response::STORED);
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, SegmentForAnotherRigIsRejectedAndTheStreamGoesOn) {
  const auto segments = TestSegments(AddRig(), 2);
  AddRig("other");
  Stream stream(segments_.get());
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::STORED);
  EXPECT_THAT(Fields(stream.Send(segments[1], "rigs/other")),
              ElementsAre("parent"));
  EXPECT_EQ(stream.Send(segments[1]).verdict(), Response::STORED);
  EXPECT_TRUE(stream.Finish().ok());
  EXPECT_FALSE(store_->GetSegment("other", segments[1].key).ok());
}

TEST_F(SegmentStreamTest, UnknownRigEndsTheStream) {
  const auto segments = TestSegments(TestRig("r"), 1);
  Stream stream(segments_.get());
  EXPECT_EQ(stream.Send(segments[0]).verdict(), Response::VERDICT_UNSPECIFIED);
  ExpectNotFound(stream.Finish(), "rigs/r");
  Stream malformed(segments_.get());
  malformed.Send(MotionSegment(), "rigs/r");
  ExpectNotFound(malformed.Finish(), "rigs/r");
}

TEST_F(SegmentStreamTest, FirstMessageWithoutARigEndsTheStream) {
  const auto segments = TestSegments(AddRig(), 1);
  for (const std::string parent : {"", "r", "rigs/r/segments/s~0"}) {
    Stream stream(segments_.get());
    stream.Send(segments[0], parent);
    EXPECT_THAT(BadFields(stream.Finish()), ElementsAre("parent"));
  }
}

TEST_F(SegmentStreamTest, EmptyStreamIsOk) {
  Stream stream(segments_.get());
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, FullDiskEndsTheStreamAndSaysWhenToRetry) {
  const auto segments = TestSegments(AddRig(), 1);
  pipeline_->submit_hook = [](const auto&) {
    return absl::ResourceExhaustedError("disk full");
  };
  Stream stream(segments_.get());
  stream.Send(segments[0]);
  const grpc::Status status = stream.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_GT(DetailOf<google::rpc::RetryInfo>(status).retry_delay().seconds(),
            0);
}

TEST_F(SegmentStreamTest, CallerThatLeavesFreesAWaitingSubmit) {
  const auto segments = TestSegments(AddRig(), 1);
  std::atomic<int> waiting = 0;
  std::atomic<int> freed = 0;
  pipeline_->submit_hook = [&](const std::function<bool()>& cancelled) {
    ++waiting;
    if (Eventually(cancelled)) ++freed;
    return absl::CancelledError("");
  };
  Stream stream(segments_.get());
  stream.Write(segments[0]);
  ASSERT_TRUE(Eventually([&] { return waiting == 1; }));
  stream.context().TryCancel();
  EXPECT_EQ(stream.Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(Eventually([&] { return freed == 1; }));
}

// A disk whose commits the test ends one by one.
class HeldCommits {
 public:
  explicit HeldCommits(FakePipeline* pipeline) {
    pipeline->begin_hook = [this](const MotionSegment&,
                                  const Pipeline::SubmitDone& done) {
      const std::lock_guard lock(mutex_);
      held_.push_back(done);
    };
  }
  std::size_t size() {
    const std::lock_guard lock(mutex_);
    return held_.size();
  }
  void End(std::size_t k, const absl::StatusOr<SubmitResult>& result) {
    Pipeline::SubmitDone done;
    {
      const std::lock_guard lock(mutex_);
      done = held_[k];
    }
    done(result);
  }
  void EndStored(std::size_t k) {
    End(k, SubmitResult{SubmitResult::Verdict::kStored, {}});
  }

 private:
  std::mutex mutex_;
  std::vector<Pipeline::SubmitDone> held_;
};

TEST_F(SegmentStreamTest, ReadsAheadOnlyWhileThereIsRoom) {
  const auto segments = TestSegments(AddRig(), 1);
  HeldCommits commits(pipeline_.get());
  Stream stream(segments_.get());
  constexpr std::size_t kSent = 7;
  for (std::size_t k = 0; k < kSent; ++k) stream.Write(segments[0]);
  ASSERT_TRUE(Eventually([&] { return commits.size() == kReadAhead; }));
  for (std::size_t k = 0; k < kSent; ++k) {
    // No more than there is room for, however many were sent.
    EXPECT_LE(commits.size(), kReadAhead + k);
    ASSERT_TRUE(Eventually([&] { return commits.size() > k; }));
    commits.EndStored(k);
    EXPECT_EQ(stream.Read().verdict(), Response::STORED);
  }
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, AnswersComeInTheOrderOfTheSegments) {
  auto segments = TestSegments(AddRig(), 3);
  HeldCommits commits(pipeline_.get());
  Stream stream(segments_.get());
  for (const MotionSegment& segment : segments) stream.Write(segment);
  ASSERT_TRUE(Eventually([&] { return commits.size() == 3; }));
  for (const std::size_t k : {2, 0, 1}) commits.EndStored(k);
  for (const MotionSegment& segment : segments) {
    EXPECT_EQ(stream.Read().index(), segment.key.index);
  }
  EXPECT_TRUE(stream.Finish().ok());
}

TEST_F(SegmentStreamTest, WhatWasStoredIsAnsweredBeforeTheErrorThatFollows) {
  const auto segments = TestSegments(AddRig(), 3);
  HeldCommits commits(pipeline_.get());
  Stream stream(segments_.get());
  for (const MotionSegment& segment : segments) stream.Write(segment);
  ASSERT_TRUE(Eventually([&] { return commits.size() == 3; }));
  commits.End(1, absl::ResourceExhaustedError("disk full"));
  commits.EndStored(2);
  commits.EndStored(0);
  EXPECT_EQ(stream.Read().verdict(), Response::STORED);
  EXPECT_EQ(stream.Read().verdict(), Response::VERDICT_UNSPECIFIED);
  EXPECT_EQ(stream.Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

TEST_F(SegmentStreamTest, CallerMayLeaveWhileItsSegmentsAreOnTheirWay) {
  const auto segments = TestSegments(AddRig(), 2);
  HeldCommits commits(pipeline_.get());
  for (int k = 0; k < 20; ++k) {
    Stream stream(segments_.get());
    for (const MotionSegment& segment : segments) stream.Write(segment);
    const std::size_t first = 2 * static_cast<std::size_t>(k);
    ASSERT_TRUE(Eventually([&] { return commits.size() == first + 2; }));
    stream.context().TryCancel();
    EXPECT_EQ(stream.Finish().error_code(), grpc::StatusCode::CANCELLED);
    commits.EndStored(first + 1);
    commits.EndStored(first);
  }
}

TEST_F(SegmentStreamTest, SegmentsOfOneStreamAreStoredInTheirOrder) {
  auto segment = TestSegments(AddRig(), 1)[0];
  Stream stream(segments_.get());
  constexpr int kSent = 40;
  std::thread writer([&] {
    for (int k = 0; k < kSent; ++k) {
      segment.key.index = k;
      stream.Write(segment);
    }
  });
  for (int k = 0; k < kSent; ++k) EXPECT_EQ(stream.Read().index(), k);
  writer.join();
  EXPECT_TRUE(stream.Finish().ok());
  for (int k = 0; k < kSent; ++k) {
    EXPECT_EQ(store_->GetSegment("r", {segment.key.session, k})->sequence,
              k + 1);
  }
}

TEST_F(SegmentStreamTest, OneStreamTooManyIsRefusedUntilAnotherEnds) {
  ServerOptions options;
  options.max_segment_streams = 2;
  StartServer(options);
  const auto segments = TestSegments(AddRig(), 1);
  Stream first(segments_.get());
  Stream second(segments_.get());
  EXPECT_EQ(first.Send(segments[0]).verdict(), Response::STORED);
  EXPECT_EQ(second.Send(segments[0]).verdict(), Response::DUPLICATE);
  Stream third(segments_.get());
  third.Send(segments[0]);
  EXPECT_EQ(third.Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(first.Finish().ok());
  EXPECT_TRUE(Eventually([&] {
    Stream again(segments_.get());
    return again.Send(segments[0]).verdict() == Response::DUPLICATE &&
           again.Finish().ok();
  }));
  EXPECT_TRUE(second.Finish().ok());
}

TEST_F(SegmentStreamTest, ExceptionEndsTheCallAndNotTheServer) {
  const auto segments = TestSegments(AddRig(), 1);
  pipeline_->submit_hook = [](const auto&) -> absl::StatusOr<SubmitResult> {
    throw std::bad_alloc();
  };
  Stream stream(segments_.get());
  stream.Send(segments[0]);
  EXPECT_EQ(stream.Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  pipeline_->submit_hook = [](const auto&) -> absl::StatusOr<SubmitResult> {
    throw std::logic_error("a mistake");
  };
  Stream second(segments_.get());
  second.Send(segments[0]);
  EXPECT_EQ(second.Finish().error_code(), grpc::StatusCode::INTERNAL);
  pipeline_->submit_hook = nullptr;
  Stream third(segments_.get());
  EXPECT_EQ(third.Send(segments[0]).verdict(), Response::STORED);
  EXPECT_TRUE(third.Finish().ok());
}

TEST_F(SegmentStreamTest, MessageOverTheLimitIsRefused) {
  ServerOptions options;
  options.max_receive_bytes = 10'000;
  StartServer(options);
  const auto segments = TestSegments(AddRig(), 1);
  ASSERT_GT(ToProto(segments[0]).ByteSizeLong(), 10'000u);
  Stream stream(segments_.get());
  stream.Send(segments[0]);
  EXPECT_EQ(stream.Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

}  // namespace
}  // namespace selfcal::server
