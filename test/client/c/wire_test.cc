// The clients for C, C++11 and C++20 send the same bytes for the same input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mutex>
#include <string>
#include <vector>

#include "client/c/selfcal.h"
#include "client/selfcal/client.h"
#include "client/selfcal/segment_builder.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/client/c/cxx11_session.h"
#include "test/client/c/session.h"
#include "test/client/selfcal/drain.h"
#include "test/support/grpc_server.h"

namespace selfcal::testing_c {
namespace {

// Keeps the bytes of the requests, and stores every segment.
class RecordingDaemon final : public v1::SegmentService::Service {
 public:
  RecordingDaemon() { server_.Start(); }
  ~RecordingDaemon() override { server_.Stop(); }

  const std::string& target() const { return server_.target(); }
  // Requests since the last call.
  std::vector<std::string> TakeRequests() {
    const std::lock_guard lock(mutex_);
    return std::exchange(requests_, {});
  }

 private:
  grpc::Status StreamSegments(
      grpc::ServerContext* /*context*/,
      grpc::ServerReaderWriter<v1::StreamSegmentsResponse,
                               v1::StreamSegmentsRequest>* stream) override {
    v1::StreamSegmentsRequest request;
    while (stream->Read(&request)) {
      v1::StreamSegmentsResponse response;
      response.set_session(request.segment().session());
      response.set_index(request.segment().index());
      response.set_verdict(v1::StreamSegmentsResponse::STORED);
      {
        const std::lock_guard lock(mutex_);
        requests_.push_back(request.SerializeAsString());
      }
      stream->Write(response);
    }
    return grpc::Status::OK;
  }

  std::mutex mutex_;
  std::vector<std::string> requests_;  // guarded by mutex_
  GrpcServer server_{{this}};
};

// 12 keyframes to a segment: three segments, and one of what is left.
constexpr int kKeyframes = 42;
constexpr int kSegments = 4;

void Send(client::SegmentBuilder* builder, client::SegmentStream* stream) {
  while (auto closed = builder->TakeClosed()) {
    stream->Send(*std::move(closed));
  }
}

Eigen::Vector3d Vector(const double (&v)[3]) { return Eigen::Vector3d(v); }

// A second IMU that reads the same.
void AddBoth(const selfcal_imu_sample& sample,
             client::SegmentBuilder* builder) {
  const ImuSample converted = {
      sample.t_ns, Vector(sample.gyro), Vector(sample.accel)};
  builder->AddImu(converted);
  builder->AddSecondImu(converted);
}

void StreamInCxx20(const std::string& target, const Session& session) {
  client::ClientOptions options;
  options.target = target;
  options.rig = "device";
  client::SegmentStream stream(options, nullptr);
  client::SegmentBuilder builder({.session = "walk",
                                  .first_index = 1,
                                  .calibration_version = 3,
                                  .keyframes = 12});
  builder.SetTemperature(21.5);
  auto sample = session.imu.begin();
  for (const Keyframe& keyframe : session.keyframes) {
    const selfcal_keyframe_state& x = keyframe.state;
    for (; sample != session.imu.end() && sample->t_ns <= x.t_ns; ++sample) {
      AddBoth(*sample, &builder);
    }
    KeyframeState state;
    state.t_ns = x.t_ns;
    state.q_GI = Eigen::Quaterniond(x.q_GI.w, x.q_GI.x, x.q_GI.y, x.q_GI.z);
    state.p_GI = Vector(x.p_GI);
    state.v_GI = Vector(x.v_GI);
    state.b_a = Vector(x.b_a);
    state.b_g = Vector(x.b_g);
    std::vector<client::KeyframeObservation> observations;
    for (const selfcal_observation& seen : keyframe.observations) {
      observations.push_back({seen.camera,
                              seen.landmark_id,
                              Eigen::Vector2d(seen.z_px),
                              Vector(seen.p_G)});
    }
    builder.AddKeyframe(state, observations);
    Send(&builder, &stream);
  }
  for (; sample != session.imu.end(); ++sample) {
    AddBoth(*sample, &builder);
  }
  builder.Flush(2);
  Send(&builder, &stream);
  EXPECT_TRUE(client::DrainFully(&stream).ok());
}

void Send(selfcal_builder* builder, selfcal_stream* stream) {
  while (selfcal_segment* segment = selfcal_builder_take(builder)) {
    EXPECT_EQ(selfcal_stream_send(stream, segment, nullptr), SELFCAL_OK);
  }
}

void StreamInC(const std::string& target, const Session& session) {
  selfcal_client_options options = {};
  options.struct_size = sizeof(options);
  options.target = target.c_str();
  options.rig = "device";
  selfcal_stream* stream = nullptr;
  ASSERT_EQ(selfcal_stream_create(&options, nullptr, nullptr, &stream, nullptr),
            SELFCAL_OK);
  selfcal_builder_options walk = {};
  walk.struct_size = sizeof(walk);
  walk.session = "walk";
  walk.first_index = 1;
  walk.calibration_version = 3;
  walk.keyframes = 12;
  selfcal_builder* builder = nullptr;
  ASSERT_EQ(selfcal_builder_create(&walk, &builder, nullptr), SELFCAL_OK);
  selfcal_builder_set_temperature(builder, 21.5, nullptr);
  auto sample = session.imu.begin();
  for (const Keyframe& keyframe : session.keyframes) {
    for (; sample != session.imu.end() && sample->t_ns <= keyframe.state.t_ns;
         ++sample) {
      selfcal_builder_add_imu(builder, &*sample, nullptr);
      selfcal_builder_add_second_imu(builder, &*sample, nullptr);
    }
    selfcal_builder_add_keyframe(builder,
                                 &keyframe.state,
                                 keyframe.observations.data(),
                                 keyframe.observations.size(),
                                 nullptr);
    Send(builder, stream);
  }
  for (; sample != session.imu.end(); ++sample) {
    selfcal_builder_add_imu(builder, &*sample, nullptr);
    selfcal_builder_add_second_imu(builder, &*sample, nullptr);
  }
  selfcal_builder_flush(builder, 2, nullptr);
  Send(builder, stream);
  EXPECT_EQ(selfcal_stream_drain(stream, 60'000, nullptr), SELFCAL_OK);
  selfcal_builder_destroy(builder);
  selfcal_stream_destroy(stream);
}

TEST(Wire, AllClientsSendTheSameBytes) {
  RecordingDaemon daemon;
  const Session session = MakeSession(kKeyframes);
  StreamInCxx20(daemon.target(), session);
  const std::vector<std::string> expected = daemon.TakeRequests();
  ASSERT_EQ(expected.size(), kSegments);

  StreamInC(daemon.target(), session);
  EXPECT_EQ(daemon.TakeRequests(), expected);

  const Cxx11Outcome outcome = StreamInCxx11(daemon.target(), session);
  EXPECT_EQ(daemon.TakeRequests(), expected);
  EXPECT_EQ(outcome.drained, SELFCAL_OK);
  EXPECT_THAT(outcome.stored, testing::ElementsAre(1, 2, 3, 4));
  EXPECT_EQ(outcome.statistics_stored, 4u);
  EXPECT_EQ(outcome.callback_failures, 1u);
  EXPECT_EQ(outcome.next_index, 5);
}

TEST(Wire, WhatTheDaemonGetsIsWhatWasGiven) {
  RecordingDaemon daemon;
  const Session session = MakeSession(kKeyframes);
  StreamInC(daemon.target(), session);
  v1::StreamSegmentsRequest request;
  const std::vector<std::string> requests = daemon.TakeRequests();
  ASSERT_EQ(requests.size(), kSegments);
  ASSERT_TRUE(request.ParseFromString(requests[0]));
  EXPECT_EQ(request.parent(), "rigs/device");
  EXPECT_EQ(request.segment().session(), "walk");
  EXPECT_EQ(request.segment().index(), 1);
  EXPECT_EQ(request.segment().calibration_version(), 3);
  EXPECT_EQ(request.segment().temperature_c(), 21.5);
  const auto& keyframes = request.segment().keyframes();
  ASSERT_EQ(keyframes.t_ns_size(), 12);
  EXPECT_EQ(keyframes.t_ns(2), session.keyframes[2].state.t_ns);
  ASSERT_EQ(keyframes.q_gi_size(), 4 * 12);
  EXPECT_EQ(keyframes.q_gi(8), 0.46);  // w x y z
  EXPECT_EQ(keyframes.q_gi(9), 0.16);
  EXPECT_EQ(keyframes.q_gi(10), -0.72);
  EXPECT_EQ(keyframes.q_gi(11), 0.49);
  ASSERT_GT(request.segment().imu().t_ns_size(), 12);
  EXPECT_EQ(request.segment().imu1().SerializeAsString(),
            request.segment().imu().SerializeAsString());
}

}  // namespace
}  // namespace selfcal::testing_c
